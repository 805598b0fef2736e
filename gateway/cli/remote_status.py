"""`plumbline remote status`: the last message of every topic, and what is known of the calibration's drift."""

import argparse
import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient

NOT_WATCHED = "not watched yet: no hour of rest has been seen since the record was made"
NO_RECORD = "not watched: no calibration record is in force"
NOT_TOLD = "not known yet: no message on health since this calibration came into force"


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> argparse.ArgumentParser:
    """Add the verb; returns its parser."""
    verb = verbs.add_parser(
        "status",
        help="the last message of every topic, and the calibration's drift",
        epilog="example: plumbline remote status",
    )
    verb.set_defaults(run=_status)
    return verb


def _status(arguments: argparse.Namespace) -> int:
    from gateway.bus.client import open_client_session, query_status
    from gateway.errors import InputError

    with open_client_session(arguments.connect) as session:
        gateways = query_status(session, arguments.gateway)
    if not gateways:
        raise InputError(f"no gateway {arguments.gateway} answers at {arguments.connect}")
    for key, topics in gateways.items():
        rest = at_rest(topics.get("health"), topics.get("calibration"))
        topics["drift"] = {"at_rest": rest, "by_records": _by_records(arguments.connect, key)}
    print(json.dumps(gateways, indent=1))
    return 0


def at_rest(health: dict[str, Any] | None, calibration: dict[str, Any] | None) -> str:
    """What readings at rest say of the record in force, in a line. Silence is never told as good news."""
    if health is None or calibration is None or health["calibration_id"] != calibration["calibration_id"]:
        return NOT_TOLD
    drift = health.get("drift")
    if drift is None:
        return NO_RECORD
    if drift["norm_error_mg"] is None:
        return NOT_WATCHED
    trend = drift["trend"]
    soon = "" if trend is None or trend["limit_in_days"] is None else f"; limit in {trend['limit_in_days']:.0f} days"
    said = f"{drift['state']}: norm {drift['norm_error_mg']:+.1f} mg of {drift['limit_mg']:.1f} mg allowed{soon}"
    return "; ".join([said, *drift["reasons"], f"shows {drift['shows']}"])


def _by_records(connect: str, key: str) -> str:
    """Within how many days to recalibrate, by the records of the device; or why that is not known."""
    from gateway.bus.client import GatewayClient
    from gateway.bus.session import BusError
    from gateway.errors import InputError

    try:
        client = GatewayClient(connect, key)
        try:
            return by_records(client)
        finally:
            client.close()
    except (InputError, BusError) as error:  # `CalibrationError` among them: fewer than two records that measure
        return f"not known: {error}"


def by_records(client: "GatewayClient") -> str:
    """The forecast of the records that a gateway has. Raises `InputError` where it cannot be made."""
    from gateway.certificate.forecast import forecast, sentence
    from gateway.cli.remote_fetch import fetch_request, fetched_records

    records, _ = fetched_records(client, fetch_request(client, {}, 0.0), 0.0)
    report = forecast(records)
    return "; ".join([sentence(report), *report.warnings])
