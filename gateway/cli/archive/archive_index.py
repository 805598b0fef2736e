"""`plumbline archive index` and `query`: tables of what is in recordings, and questions to them in SQL.

The options of source, table and keys are those of the other verbs as well.
"""

import argparse
import hashlib
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.command import Option, command, option
from gateway.cli.output import JSON_OPTION
from gateway.cli.recording_options import CA_OPTION, refusal_by
from gateway.errors import WITH_LOSSES
from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.archive.admission import Authority, KeyOf
    from gateway.archive.index import IndexResult
    from gateway.archive.query import QueryAnswer
    from gateway.archive.rows import IndexedFile

NOT_VERIFIED = "*"
SOURCE_OPTION = option(
    "source",
    metavar="SOURCE",
    help="folder with recordings of any gateways, at any depth, or an object store: s3://bucket/prefix",
)
"""The source of the recordings."""


def table_option(name: str = "--table") -> Option:
    """Return the place of the tables."""
    return option(
        name,
        dest="table",
        required=True,
        metavar="TABLE",
        help="folder or object store with the tables, which plumbline archive index makes",
    )


KEYS_OPTIONS = (
    option(
        "--keys",
        type=Path,
        metavar="FILE",
        help="public keys of the gateways: lines <site>/<crane>/<sensor> <64 digits, or a .pub file>; without one those that "
        "plumbline remote status has heard at the first contact",
    ),
    CA_OPTION,
)
"""The public keys of the gateways, and the CA that vouches for others."""


def authority_of(arguments: argparse.Namespace) -> "Authority | None":
    """Return the CA of the options. Raises `InputError`."""
    from gateway.archive.admission import Authority

    if arguments.ca is None:
        return None
    refuse = refusal_by(arguments.ca)
    return Authority(refuse, hashlib.sha256(arguments.ca.read_bytes()).hexdigest())


def keys(arguments: argparse.Namespace) -> "KeyOf":
    """Return the keys of the options. Raises `InputError` and `KeyFileError`."""
    from gateway.archive.admission import known_key, read_keys

    return known_key if arguments.keys is None else read_keys(arguments.keys)


def day(text: str) -> datetime:
    """Return the begin of a day, UTC. Raises `ValueError`."""
    try:
        begin = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{text} is no day such as 2026-11-22") from None
    return begin if begin.tzinfo is not None else begin.replace(tzinfo=UTC)


@command(
    "index",
    "put what is in recordings into open tables: swings, motion, alerts, conditions, health, calibrations, clock",
    "Put what is in recordings into Delta Lake tables, which any engine reads. Signatures are verified first; "
    "each row says whether its recording is verified, consistent in itself only, or not signed. What is there already is not "
    "read again, and nothing counts twice: the command may be repeated, interrupted, and run several times at once. Exit "
    "code 3: a file was refused, with the reason.",
    "example: plumbline archive index /srv/recordings --into /srv/archive --keys keys.txt",
    SOURCE_OPTION,
    table_option("--into"),
    *KEYS_OPTIONS,
    option(
        "--compact", action="store_true", help="then join the small files that many runs have made; once a day will do"
    ),
    JSON_OPTION,
)
def run_index(arguments: argparse.Namespace) -> int:
    """Index the recordings; return 3 where a file was refused."""
    require_extra("archive")
    from gateway.archive.index import index
    from gateway.archive.source import open_source
    from gateway.archive.tables import Archive
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar

    source, key_of, authority = open_source(arguments.source), keys(arguments), authority_of(arguments)
    with ProgressBar(f"indexing {source.name}") as bar:
        archive = Archive(arguments.table)
        result = index(source, archive, key_of, authority, bar.update)
        if arguments.compact:
            archive.compact()
    show(_index_text(result), _index_json(result), arguments.json)
    return WITH_LOSSES if any(file.trust == "refused" for file in result.read) else 0


def _index_text(result: "IndexResult") -> str:
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


def _index_json(result: "IndexResult") -> dict[str, Any]:
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


@command(
    "query",
    "put a question in SQL to the tables",
    "Put a question in SQL to the tables of an archive: recordings, swings, motion, minutes, alerts, conditions, "
    "health, calibrations, clock. Only rows that count are seen. A row of the answer that would be another one without the "
    "recordings that are not verified is marked *.",
    "example: plumbline archive query 'SELECT crane, max(phi_max_deg) FROM swings GROUP BY 1' --table /srv/archive",
    option("sql", metavar="SQL", help="one SELECT, in the dialect of DuckDB"),
    table_option(),
    option("--verified", action="store_true", help="leave out recordings that are not verified"),
    JSON_OPTION,
)
def run_query(arguments: argparse.Namespace) -> int:
    """Print the answer."""
    require_extra("archive")
    from gateway.archive.query import ask
    from gateway.archive.tables import Archive
    from gateway.cli.output import show

    answer = ask(Archive(arguments.table), arguments.sql, verified_only=arguments.verified)
    show(_query_text(answer), _query_json(answer), arguments.json)
    return 0


def _query_text(answer: "QueryAnswer") -> str:
    cells = [[" ", *answer.columns]]
    for row, is_verified in zip(answer.rows, answer.is_verified, strict=True):
        cells.append(
            [" " if is_verified else NOT_VERIFIED, *("" if each is None else str(_plain(each)) for each in row)]
        )
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [" ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells]
    trust = ", ".join(f"{count} {name}" for name, count in answer.trust.items()) or "no recordings"
    marked = sum(not each for each in answer.is_verified)
    note = f"; {NOT_VERIFIED} rests on recordings that are not verified ({marked} rows)" if marked else ""
    return "\n".join([*lines, f"{len(answer.rows)} rows from {trust}{note}"])


def _query_json(answer: "QueryAnswer") -> dict[str, Any]:
    return {
        "columns": list(answer.columns),
        "rows": [[_plain(each) for each in row] for row in answer.rows],
        "is_verified": list(answer.is_verified),
        "recordings": answer.trust,
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON has it."""
    if isinstance(value, datetime | date):
        return value.isoformat()
    return value if isinstance(value, str | int | float | bool | None) else str(value)
