"""The checks of `plumbline doctor` beside a gateway that runs: the gateway itself is asked over its bus."""

from collections.abc import Iterator
from getpass import getuser
from typing import Any

from gateway.bus.authenticity import Authenticity
from gateway.bus.client import StatusAnswer, open_client_session, query_status
from gateway.bus.credentials import VARIABLE, gateway_credentials
from gateway.configuration.model import Configuration
from gateway.daemon.doctor import CheckResult, Grade
from gateway.errors import InputError, PlumblineError
from gateway.page.verdict import TRUSTED_CALIBRATIONS

MAX_LOST_SHARE = 0.01
"""Share of lost samples from which on it is reported. Basis: a choice; a late block loses less, and a bad wire more."""

UNDER_WAY = ("collecting", "review")
"""Phases of a recalibration in which a person is at work."""


def examine_running(configuration: Configuration) -> Iterator[CheckResult]:
    """Report the state of the running gateway: sampling, recording, calibration, alerts."""
    folder, key = configuration.gateway.data_dir, configuration.gateway.key
    try:
        answer = query_gateway(configuration)
    except InputError:
        yield CheckResult(
            "note",
            "gateway",
            f"runs with {folder}, and was not asked how it does: {getuser()} may not read the certificate of bus.tls; run doctor "
            f"as the gateway's user, or name a folder that plumbline keys issue has made in {VARIABLE}",
        )
        return
    except PlumblineError as error:
        yield CheckResult("bad", "gateway", f"does not answer, though one runs with {folder}: {error}")
        return
    if answer is None:
        text = f"{key} does not answer, though one runs with {folder}: has the gateway another configuration?"
        yield CheckResult("bad", "gateway", text)
        return
    if answer.doubt is not None:
        yield CheckResult("note", "signature", str(answer.doubt))
    yield from _report(answer.topics)


def query_gateway(configuration: Configuration) -> StatusAnswer | None:
    """Return the answer of the gateway of this machine; None: it does not answer.

    Raises `BusError`, and `InputError` where it asks for a certificate and this user has none.
    """
    key, credentials = configuration.gateway.key, gateway_credentials(configuration.bus.tls)
    for endpoint in configuration.bus.local_endpoints:
        with open_client_session(endpoint, credentials) as session:
            return query_status(session, key, Authenticity(credentials.signers)).get(key)
    return None


def _report(topics: dict[str, Any]) -> Iterator[CheckResult]:
    health = topics.get("health") or {}
    if health.get("state") != "running":
        yield CheckResult("bad", "gateway", f"is {health.get('state', 'starting')}")
    else:
        uptime = f"{health['uptime_s'] / 3600:.1f} h" if health["uptime_s"] >= 3600 else f"{health['uptime_s']:.0f} s"
        yield CheckResult("good", "gateway", f"has been running for {uptime}, version {health['software']}")
    rate_hz, lost, samples = health.get("measured_rate_hz"), health.get("lost", 0), health.get("samples", 0)
    rate = "rate not known yet" if rate_hz is None else f"{rate_hz:.1f} Hz"
    few_lost = lost <= MAX_LOST_SHARE * samples
    yield CheckResult(
        "good" if few_lost else "bad", "device", f"{health.get('device_id')} at {rate}, {lost} of {samples} lost"
    )
    faults = {name: count for name, count in {**health.get("faults", {}), **health.get("dropped", {})}.items() if count}
    if faults:
        listed = ", ".join(f"{name} {count}" for name, count in faults.items())
        yield CheckResult("note", "faults", f"since the start: {listed}")
    error = health.get("recording_error")
    yield CheckResult("bad" if error else "good", "recording", error or health.get("recording") or "off")
    calibration = topics.get("calibration") or {}
    trusted = calibration.get("status") in TRUSTED_CALIBRATIONS
    yield CheckResult("good" if trusted else "note", "calibration", calibration.get("text") or "not known yet")
    if offer := health.get("offer"):
        yield CheckResult("note", "offered", f"record {offer['record']}: {offer['text']}")
    if changed := health.get("changed_limits"):
        yield CheckResult("note", "limits", f"not those of commissioning: {'; '.join(changed)}")
    alert = topics.get("alert") or {}
    grade: Grade = "good" if alert.get("level") == "normal" else "note"
    is_suspended = alert.get("validity") == "suspended"
    if is_suspended and (calibration.get("session") or {}).get("phase") not in UNDER_WAY:
        grade = "bad"  # nobody is warned until a person ends it
    yield CheckResult(grade, "alerts", alert.get("text") or "not known yet", {"suspended": is_suspended})
