"""`plumbline remote fetch`: the calibration records of a gateway, their certificates, history and audit, as files."""

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.bus_link import connect_endpoint
from gateway.cli.output import write_text

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient
    from gateway.calibration.record import CalibrationRecord

DAMAGED = 1
PATIENCE_S = 30.0


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> argparse.ArgumentParser:
    """Add the verb; return its parser."""
    fetch = verbs.add_parser(
        "fetch",
        help="write the calibration records with their certificates, history and audit to files",
        description="Write the calibration records of a gateway with their certificates, history and audit to files.",
        epilog="example: plumbline remote fetch --out records/",
    )
    fetch.add_argument(
        "--out", type=Path, default=Path(), metavar="FOLDER", help="an existing folder (default: the present one)"
    )
    fetch.set_defaults(run=_fetch)
    return fetch


def _fetch(arguments: argparse.Namespace) -> int:
    from gateway.bus.client import GatewayClient

    client = GatewayClient(connect_endpoint(arguments), arguments.gateway)
    try:
        listed = fetch_request(client, {}, PATIENCE_S)
        records, damaged = fetch_records(client, listed, PATIENCE_S)
        reviewed = listed["review"]
        candidate = None if reviewed is None else _record(client, reviewed, PATIENCE_S)
        audit = fetch_request(client, {"what": "audit", "lines": 1000}, PATIENCE_S)["audit"]
    finally:
        client.close()
    for record in records:
        _write(arguments.out, record.id, record, records)
    if candidate is not None:
        _write(arguments.out, f"review-{candidate.id}", candidate, records)
    state = {name: listed[name] for name in ("device_id", "in_force", "history")}
    write_text(arguments.out / "in_force.json", json.dumps(state, indent=1) + "\n")
    write_text(arguments.out / "audit.jsonl", "".join(json.dumps(entry) + "\n" for entry in audit))
    for problem in damaged:
        print(problem, file=sys.stderr)
    print(f"{arguments.out}: {len(records)} records of {listed['device_id']}, in force {listed['in_force']}")
    return DAMAGED if damaged else 0


def fetch_records(
    client: "GatewayClient", listed: dict[str, Any], patience_s: float
) -> tuple[list["CalibrationRecord"], list[str]]:
    """Return the readable records, and what is wrong with the others. Raises `InputError` where nobody answers."""
    from gateway.calibration.record import CalibrationError

    records, damaged = [], []
    for entry in listed["records"]:
        if "error" in entry:
            damaged.append(f"{entry['id']}: {entry['error']}")
            continue
        try:
            records.append(_record(client, entry["id"], patience_s))
        except CalibrationError as error:
            damaged.append(str(error))
    return records, damaged


def fetch_request(client: "GatewayClient", request: dict[str, Any], patience_s: float) -> dict[str, Any]:
    """Return the answer to a read request. Raises `InputError`."""
    from gateway.errors import InputError

    reply = client.ask("fetch", request, patience_s)
    if reply is None:
        raise InputError(f"{client.key} does not answer")
    if not reply.accepted:
        raise InputError(f"{client.key}: {reply.text}")
    return reply.content


def _record(client: "GatewayClient", record_id: str, patience_s: float) -> "CalibrationRecord":
    from gateway.calibration.store import parse_record

    content = fetch_request(client, {"what": "record", "record": record_id}, patience_s)["record"]
    return parse_record(content, str(content.get("device_id")), f"record {record_id} of {client.key}")


def _write(folder: Path, name: str, record: "CalibrationRecord", records: list["CalibrationRecord"]) -> None:
    """Write a record and its certificate."""
    from gateway.certificate.page import render_certificate

    parent = next((one for one in records if one.id == record.parent), None)
    earlier = [one for one in records if one.created_utc < record.created_utc]
    write_text(folder / f"{name}.json", json.dumps(record.model_dump(mode="json"), indent=1) + "\n")
    write_text(folder / f"{name}.html", render_certificate(record, parent, earlier))
