"""`plumbline archive index`: makes tables of what is in recordings."""

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from gateway.cli.archive.archive_options import add_keys, add_source, add_table, authority_of, keys
from gateway.cli.command import command, option
from gateway.cli.terminal.output import add_json
from gateway.errors import WITH_LOSSES
from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.archive.index import IndexResult
    from gateway.archive.rows import IndexedFile


@command(
    "index",
    "put what is in recordings into open tables: swings, motion, alerts, conditions, health, calibrations, clock",
    "Put what is in recordings into Delta Lake tables, which any engine reads. Signatures are verified first; "
    "each row says whether its recording is verified, consistent in itself only, or not signed. What is there already is not "
    "read again, and nothing counts twice: the command may be repeated, interrupted, and run several times at once. Exit "
    "code 3: a file was refused, with the reason.",
    "example: plumbline archive index /srv/recordings --into /srv/archive --keys keys.txt",
    add_source,
    partial(add_table, option="--into"),
    add_keys,
    option(
        "--compact", action="store_true", help="then join the small files that many runs have made; once a day will do"
    ),
    add_json,
)
def run_index(arguments: argparse.Namespace) -> int:
    """Index the recordings; return 3 where a file was refused."""
    require_extra("archive")
    from gateway.archive.index import index
    from gateway.archive.source import open_source
    from gateway.archive.tables import Archive
    from gateway.cli.terminal.output import show
    from gateway.cli.terminal.progress import ProgressBar

    source, key_of, authority = open_source(arguments.source), keys(arguments), authority_of(arguments)
    with ProgressBar(f"indexing {source.name}") as bar:
        archive = Archive(arguments.table)
        result = index(source, archive, key_of, authority, bar.update)
        if arguments.compact:
            archive.compact()
    show(_text(result), _as_json(result), arguments.json)
    return WITH_LOSSES if any(file.trust == "refused" for file in result.read) else 0


def _text(result: "IndexResult") -> str:
    lines = [
        f"{file.row.path}: {file.row.status}{f', {file.trust}' if file.trust != 'refused' else ''}"
        + (f" ({file.row.reason})" if file.row.reason else "")
        for file in sorted(result.read, key=lambda file: file.row.path)
        if file.trust != "verified" or file.row.status != "counted"
    ]
    counts = {
        trust: sum(file.trust == trust for file in result.read)
        for trust in ("verified", "consistent", "unsigned", "refused")
    }
    told = ", ".join(f"{count} {trust}" for trust, count in counts.items() if count) or "nothing new"
    return "\n".join([*lines, f"{result.files} recordings in the source, {len(result.read)} read now: {told}"])


def _as_json(result: "IndexResult") -> dict[str, Any]:
    return {"files": result.files, "read": [_file_json(file) for file in result.read]}


def _file_json(file: "IndexedFile") -> dict[str, Any]:
    return {
        "path": file.row.path,
        "recording": file.recording,
        "gateway": None if file.gateway is None else "/".join(file.gateway),
        "status": file.row.status,
        "trust": file.trust,
        "reason": file.row.reason,
    }
