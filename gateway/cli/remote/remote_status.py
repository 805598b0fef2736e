"""`plumbline remote status`: how a gateway is, with the drift of its calibration; on request its last messages as JSON."""

import argparse
import sys
import time
from contextlib import closing, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from gateway.cli.argument_types import key_fingerprint
from gateway.cli.bus_link import ADDRESS_OPTIONS, client_credentials, connect_endpoint
from gateway.cli.command import command, option
from gateway.cli.output import output_file
from gateway.errors import printable

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient
    from gateway.bus.credentials import Credentials

NO_REST = "not known yet: no hour at rest since the record was made"
NO_RECORD = "not monitored: no calibration record is in force"
NOT_VALID = "not known: the drift in the health message has another form; is the gateway of another version?"
NO_HEALTH = "not known yet: no health message since this calibration came into force"


@command(
    "status",
    "print how a gateway is: state, swing, alerts, calibration with its drift, device, recording",
    "Print how a gateway is: state, swing, alerts, calibration with its drift, device and recording.",
    "examples: plumbline remote status | plumbline remote status --json -",
    option(
        "--json",
        type=output_file,
        metavar="FILE",
        help="also write the last message of every topic, and the drift, as JSON; -: print it instead of the text",
    ),
    option(
        "--accept-key",
        type=key_fingerprint,
        metavar="FINGERPRINT",
        help="take the key with this fingerprint for that of the gateway, in place of one that was pinned; compare it with "
        "what plumbline run prints at the gateway",
    ),
    *ADDRESS_OPTIONS,
)
def run_status(arguments: argparse.Namespace) -> int:
    """Print the state of every gateway that answers."""
    from gateway.bus.authenticity import Authenticity
    from gateway.bus.client import open_client_session, query_status
    from gateway.cli.output import show
    from gateway.errors import InputError
    from gateway.fleet.status_text import judge_answer, status_lines

    connect = connect_endpoint(arguments)
    credentials = client_credentials(arguments)
    with open_client_session(connect, credentials) as session:
        authenticity = Authenticity(credentials.signers, arguments.accept_key)
        answers = query_status(session, arguments.gateway, authenticity)
    if not answers:
        raise InputError(f"no gateway {arguments.gateway} answers at {connect}")
    if arguments.accept_key is not None and not any(_is_pinned(key, arguments.accept_key) for key in answers):
        raise InputError(
            f"--accept-key {arguments.accept_key}: no key is pinned: none that answers has this fingerprint"
        )
    now_s, now_utc = time.monotonic(), datetime.now(UTC)
    pages, gateways = [], {}
    for key, answer in answers.items():
        topics = gateways[key] = answer.topics
        status, messages = judge_answer(key, topics, answer.doubt, now_s, now_utc)
        valid = {topic: topics[topic] for topic in messages}
        at_rest = describe_rest_drift(valid.get("health"), valid.get("calibration"))
        drift = {"at_rest": at_rest, "by_records": _forecast_text(connect, key, credentials)}
        if answer.doubt is None:
            note_statement(valid.get("health"))
        else:
            print(f"plumbline remote: {key}: {printable(str(answer.doubt))}", file=sys.stderr)
        pages.append("\n".join(map(printable, status_lines(status, messages, drift, now_utc))))
        topics["drift"] = drift
    show("\n\n".join(pages), gateways, arguments.json)
    return 0


def _is_pinned(gateway: str, accepted: str) -> bool:
    from gateway.bus.known_gateways import known_statement
    from gateway.pki.signing_key import fingerprint

    known = known_statement(gateway)
    return known is not None and fingerprint(known.public_key) == accepted


def note_statement(health: dict[str, Any] | None) -> None:
    """Pin the key of a gateway at the first contact, and keep its newest statement, for `record verify`; warn of another key."""
    from pydantic import TypeAdapter, ValidationError

    from gateway.bus.known_gateways import can_pin, remember_statement
    from gateway.messages import NewestStatement

    if health is None or health.get("newest_statement") is None:
        return
    with suppress(ValidationError):
        heard = TypeAdapter(NewestStatement).validate_python(health["newest_statement"])
        problem = remember_statement(heard) if can_pin(heard.gateway) else None
        if problem is not None:
            print(f"plumbline remote: {printable(problem)}", file=sys.stderr)


def describe_rest_drift(health: dict[str, Any] | None, calibration: dict[str, Any] | None) -> str:
    """Return the drift of the record in force by readings at rest, as one line. Missing readings are never good news."""
    from pydantic import TypeAdapter, ValidationError

    from gateway.calibration.drift.rest_status import RestStatus

    if health is None or calibration is None or health["calibration_id"] != calibration["calibration_id"]:
        return NO_HEALTH
    if health.get("drift") is None:
        return NO_RECORD
    try:
        drift = TypeAdapter(RestStatus).validate_python(health["drift"])
    except ValidationError:
        return NOT_VALID
    if drift.norm_error_mg is None:
        return NO_REST
    trend = drift.trend
    soon = "" if trend is None or trend.limit_in_days is None else f"; limit in {trend.limit_in_days:.0f} days"
    state = f"{drift.state}: norm {drift.norm_error_mg:+.1f} mg of {drift.limit_mg:.1f} mg allowed{soon}"
    return "; ".join([state, *drift.reasons, f"shows {drift.shows}"])


def _forecast_text(connect: str, key: str, credentials: "Credentials") -> str:
    """Return when to recalibrate, by the records of the device; or why that is not known."""
    from gateway.bus.client import GatewayClient
    from gateway.bus.session import BusError
    from gateway.errors import InputError

    try:
        with closing(GatewayClient(connect, key, credentials)) as client:
            return describe_forecast(client)
    except (InputError, BusError) as error:  # including `CalibrationError` for too few records
        return f"not known: {error}"


def describe_forecast(client: "GatewayClient") -> str:
    """Return the forecast by the records of a gateway that counted. Raises `InputError` where there are too few."""
    from gateway.bus.client import FetchedList
    from gateway.calibration.store import standing_records
    from gateway.certificate.comparison import forecast, sentence
    from gateway.cli.remote.remote_fetch import fetch_records, fetch_request

    listed = fetch_request(client, {}, FetchedList, 0.0)
    if listed.history:
        standing = standing_records((each.get("from"), each.get("to")) for each in listed.history)
        listed = listed.model_copy(update={"records": [each for each in listed.records if each.id in standing]})
    report = forecast(fetch_records(client, listed, 0.0)[0])
    return "; ".join([sentence(report), *report.warnings])
