"""`plumbline record info` and `verify`: what is in recordings, and whether they are what the gateway wrote."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION
from gateway.cli.record.known_key import KEY_OPTION, key_of_recordings
from gateway.cli.recording_options import CA_OPTION, PATHS_OPTION, SELECTION_OPTIONS, interval
from gateway.errors import ANSWER_IS_NO, WITH_LOSSES

if TYPE_CHECKING:
    from gateway.recording.chain.chain_verification import ChainVerification
    from gateway.recording.chain.file_verification import FileVerification

INFO_EXAMPLE = """examples:
  plumbline record info plumbline-data
  plumbline record info plumbline-data --last 1:00:00 --local
  plumbline record info plumbline-data/*.mcap --json -"""
EXIT_CODES = {"genuine": 0, "differs": ANSWER_IS_NO, "consistent": WITH_LOSSES}
"""Definition: exit codes of the answers."""
ANSWERS = {
    "genuine": "genuine: everything is as the gateway's key signed",
    "consistent": "consistent in itself only: nothing differs from what was signed, but whoever wrote the files may "
    "have signed them; give the gateway's public key with --key",
    "differs": "NOT genuine: see above",
}


@command(
    "info",
    "print what is in recordings: times, alerts, calibrations, gaps, faults, losses, topics",
    "Print what is in recordings: times, alerts from raised to cleared, changes of calibration and clock, gaps, "
    "faults, losses and topics. The segments of a gateway are one timeline; several gateways are printed one by one.",
    INFO_EXAMPLE,
    *SELECTION_OPTIONS,
    JSON_OPTION,
)
def run_info(arguments: argparse.Namespace) -> int:
    """Print the content of the recordings."""
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar
    from gateway.recording.export.info_text import info_text
    from gateway.recording.export.recording_info import summarise_timeline
    from gateway.recording.format.salvage import is_damaged
    from gateway.recording.reading.timeline import open_timelines

    chosen = interval(arguments)
    found = []
    for timeline in open_timelines(arguments.paths):
        with ProgressBar(f"reading {timeline.gateway}") as bar:
            found.append(summarise_timeline(timeline, chosen, bar.update))
    content = [info.as_json() for info in found] if len(found) > 1 else found[0].as_json()
    show("\n\n".join(info_text(info, is_local=arguments.local) for info in found), content, arguments.json)
    return WITH_LOSSES if any(is_damaged(info.losses) for info in found) else 0


@command(
    "verify",
    "check that recordings are what the gateway wrote: nothing changed, removed, exchanged or forged",
    "Check recordings against the signed statements in them: nothing changed, removed, exchanged, cut off or "
    "forged, and no clock set back by more than 30 s. Exit code 0: genuine by the key that is given, for which the site's CA "
    "vouches, or that `remote status` has heard at the first contact. Exit code 1: something differs, and each difference is "
    "named. Exit code 3: consistent in itself only, because no key is known, or nothing is signed. A folder is expected from "
    "the first segment on: those that the gateway has deleted, as it has signed, are named and are no difference.",
    "example: plumbline record verify plumbline-data --key signing-key.pem.pub",
    PATHS_OPTION,
    KEY_OPTION,
    CA_OPTION,
    option(
        "--heard",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="health messages that somebody kept, as `remote status --json FILE` writes them: what they say of the newest "
        "segment must be there",
    ),
    option(
        "--tsa-ca",
        type=Path,
        metavar="FILE",
        help="certificates, in PEM, of the CA of the time stamp authority that the gateway asks: its time stamps are "
        "checked, "
        "and what they are about must be there",
    ),
    option(
        "--time-stamps",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="time stamps that were kept elsewhere, beside those in the folders: a copy of time-stamps.jsonl",
    ),
    JSON_OPTION,
)
def run_verify(arguments: argparse.Namespace) -> int:
    """Verify recordings; return the exit code of the answer."""
    from gateway.bus.known_gateways import read_statements
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar
    from gateway.pki.signing_key import fingerprint
    from gateway.recording.chain.chain_verification import verify_chain
    from gateway.recording.chain.file_verification import verify_file
    from gateway.recording.chain.time_stamps import describe_proven, list_time_stamp_files, load_verifier, prove_all
    from gateway.recording.reading.timeline import list_recordings

    paths = list_recordings(arguments.paths)
    known = key_of_recordings(arguments.key, arguments.ca, paths)
    key, vouched = known.public_key, known.vouched
    heard = [statement for path in arguments.heard for statement in read_statements(path)]
    heard += [] if known.heard is None or known.heard.public_key != key else [known.heard]
    folders = [path for path in arguments.paths if path.is_dir()]
    stamp_files = [*arguments.time_stamps, *(file for folder in folders for file in list_time_stamp_files(folder))]
    verifier = None if arguments.tsa_ca is None else load_verifier(arguments.tsa_ca)
    proven, remarks = prove_all(stamp_files, verifier)
    heard += [each.statement for each in proven]
    found = []
    with ProgressBar("verifying") as bar:
        for number, path in enumerate(paths):
            bar.update(number / len(paths))
            found.append(verify_file(path, key))
    chain = verify_chain(found, folders, key, heard)
    said = [*describe_proven(proven), *remarks]
    if vouched is not None and vouched.refusal is not None:
        chain = replace(chain, problems=(*chain.problems, f"NOT VOUCHED FOR: {vouched.refusal}"))
    elif vouched is not None and vouched.public_key is not None:
        said.append(f"the site's CA vouches for the key {fingerprint(vouched.public_key)} of {vouched.gateway}")
    elif vouched is not None:
        said.append("the site's CA was not asked: no segment has a voucher, for the gateway had no certificate")
    stamps = [{"segment": each.statement.segment, "time_utc": each.at.isoformat()} for each in proven]
    content = {**chain.as_json(), "time_stamps": stamps, "time_stamp_remarks": remarks}
    content["vouched_key"] = None if vouched is None else vouched.public_key
    show(_text(chain, key, said, is_pinned=known.is_pinned), content, arguments.json)
    return EXIT_CODES[chain.answer]


def _text(chain: "ChainVerification", key: str | None, said: list[str], *, is_pinned: bool) -> str:
    from gateway.pki.signing_key import fingerprint

    lines = [line for file in chain.files for line in _file_lines(file)]
    if chain.segments:
        lines.append(f"the files are segments {chain.segments[0]} to {chain.segments[-1]}")
    lines += [f"  {problem}" for problem in chain.problems] + [f"  {remark}" for remark in chain.remarks]
    lines += [f"  {text}" for text in said]
    if is_pinned and key is not None:
        lines.append(f"key {fingerprint(key)} is pinned: this user heard it from the gateway at the first contact")
    if key is None and chain.public_keys:
        lines.append(f"key {fingerprint(chain.public_keys[0])} stands in the recordings themselves")
    lines.append(ANSWERS[chain.answer])
    return "\n".join(lines)


def _file_lines(file: "FileVerification") -> list[str]:
    from gateway.recording.reading.interval import iso_utc

    statement = file.statement
    number = "no segment" if file.segment is None else f"segment {file.segment}"
    signed = "nothing signed" if statement is None else f"signed up to {iso_utc(statement.to_ns)}"
    if file.is_final and not file.problems:
        signed = f"signed whole, up to {iso_utc(statement.to_ns) if statement else ''}"
    lines = [f"{file.path}: {number}, {signed}"]
    return lines + [f"  {text}" for text in (*file.problems, *file.remarks)]
