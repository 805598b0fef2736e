"""`plumbline remote fetch`: the calibration records of a gateway, their certificates, history and audit, as files."""

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from gateway.cli.bus_link import ADDRESS_OPTIONS, MAX_ANSWER_WAIT_S, gateway_client
from gateway.cli.command import command, option
from gateway.cli.output import write_text
from gateway.errors import ANSWER_IS_NO, InputError, printable

if TYPE_CHECKING:
    from collections.abc import Collection

    from pydantic import BaseModel

    from gateway.bus.client import FetchedList, GatewayClient
    from gateway.calibration.record import CalibrationRecord

Answer = TypeVar("Answer", bound="BaseModel")


@command(
    "fetch",
    "write the calibration records with their certificates, history and audit to files",
    "Write the calibration records of a gateway with their certificates, history and audit to files.",
    "example: plumbline remote fetch --out records/",
    option(
        "--out",
        type=Path,
        default=Path(),
        metavar="FOLDER",
        help="a folder, made if missing (default: the present one)",
    ),
    *ADDRESS_OPTIONS,
)
def run_fetch(arguments: argparse.Namespace) -> int:
    """Write what the gateway has; return 1 where a record is damaged."""
    from gateway.bus.client import FetchedAudit, FetchedList
    from gateway.calibration.store import standing_records

    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {arguments.out}: cannot be made ({error.strerror}); choose another place") from error
    with gateway_client(arguments) as client:
        listed = fetch_request(client, {}, FetchedList, MAX_ANSWER_WAIT_S)
        records, damaged = fetch_records(client, listed, MAX_ANSWER_WAIT_S)
        reviewed = listed.review
        candidate = None if reviewed is None else _record(client, reviewed, MAX_ANSWER_WAIT_S)
        audit = fetch_request(client, {"what": "audit", "lines": 1000}, FetchedAudit, MAX_ANSWER_WAIT_S).audit
    standing = standing_records((each.get("from"), each.get("to")) for each in listed.history)
    for record in records:
        _write(arguments.out, record.id, record, records, standing)
    if candidate is not None:
        _write(arguments.out, f"review-{candidate.id}", candidate, records, standing)
    state = listed.model_dump(mode="json", include={"device_id", "in_force", "history"})
    write_text(arguments.out / "in_force.json", json.dumps(state, indent=1) + "\n")
    write_text(arguments.out / "audit.jsonl", "".join(json.dumps(entry) + "\n" for entry in audit))
    for problem in damaged:
        print(printable(problem), file=sys.stderr)
    in_force = (
        "none of them in force: the factory's, if it has one"
        if listed.in_force is None
        else f"in force {listed.in_force}"
    )
    print(printable(f"{arguments.out}: {len(records)} records of {listed.device_id}, {in_force}"))
    return ANSWER_IS_NO if damaged else 0


def fetch_records(
    client: "GatewayClient", listed: "FetchedList", patience_s: float
) -> tuple[list["CalibrationRecord"], list[str]]:
    """Return the readable records, and what is wrong with the others. Raises `InputError` where nobody answers."""
    from gateway.calibration.record import CalibrationError

    records, damaged = [], []
    for entry in listed.records:
        if entry.error is not None:
            damaged.append(f"{entry.id}: {entry.error}")
            continue
        try:
            records.append(_record(client, entry.id, patience_s))
        except CalibrationError as error:
            damaged.append(str(error))
    return records, damaged


def fetch_request(
    client: "GatewayClient", request: dict[str, Any], model: "type[Answer]", patience_s: float
) -> "Answer":
    """Return the answer to a read request. Raises `InputError`, also for what is no answer of a gateway."""
    from pydantic import ValidationError

    from gateway.errors import describe_problems

    reply = client.ask("fetch", request, patience_s)
    if reply is None:
        raise InputError(f"{client.key} does not answer")
    if not reply.accepted:
        raise InputError(f"{client.key}: {reply.text}")
    try:
        return model.model_validate(reply.content)
    except ValidationError as error:
        raise InputError(
            f"{client.key}: its answer is not valid: {describe_problems(error)[0]}; nothing is written"
        ) from error


def _record(client: "GatewayClient", record_id: str, patience_s: float) -> "CalibrationRecord":
    from gateway.bus.client import FetchedRecord
    from gateway.calibration.record import CalibrationError
    from gateway.calibration.store import parse_record

    content = fetch_request(client, {"what": "record", "record": record_id}, FetchedRecord, patience_s).record
    record = parse_record(content, str(content.get("device_id")), f"record {record_id} of {client.key}")
    if record.id != record_id:
        raise CalibrationError(f"record {record_id} of {client.key}: another record came, {record.id}")
    return record


def _write(
    folder: Path,
    name: str,
    record: "CalibrationRecord",
    records: list["CalibrationRecord"],
    standing: "Collection[str]",
) -> None:
    """Write a record and its certificates, whose forecast counts the earlier records that were not withdrawn."""
    from gateway.recording.segments.segment import calibration_files

    parent = next((one for one in records if one.id == record.parent), None)
    earlier = [one for one in records if one.id in standing and one.created_utc < record.created_utc]
    for file in calibration_files(record, parent, earlier).files:
        write_text(folder / f"{name}{Path(file.name).suffix}", file.data.decode())
