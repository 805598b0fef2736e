"""`plumbline archive delete`: recordings and their rows go by a rule, and an audit stays."""

import argparse
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from gateway.cli.archive.archive_index import SOURCE_OPTION, day, table_option
from gateway.cli.argument_types import parsed_by
from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION
from gateway.extras import require_extra

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gateway.archive.rows import IndexedFile


@command(
    "delete",
    "delete recordings that ended before a day, with their rows; what was deleted, by whom and why stays",
    "Delete recordings that ended before a day from a source, and their rows from the tables. The table "
    "recordings keeps name, hashes, by whom and why, as status deleted, so that the chain of evidence goes on; what was "
    "deleted is not indexed again. Without --yes nothing is deleted, and what would be is said.",
    "example: plumbline archive delete /srv/recordings --table /srv/archive --before 2025-01-01 --by ann "
    "--because 'kept for a year' --yes",
    SOURCE_OPTION,
    table_option(),
    option(
        "--before", type=parsed_by(day), required=True, metavar="DAY", help="recordings that ended before this day, UTC"
    ),
    option("--crane", metavar="NAME", help="those of this crane alone"),
    option("--by", required=True, metavar="WHO", help="who deletes"),
    option("--because", required=True, metavar="WHY", help="why, such as the rule of retention"),
    option(
        "--names",
        action="store_true",
        help="leave recordings and rows, and empty the columns of the tables that may name people: calibrations.record, "
        "results.content",
    ),
    option("--yes", action="store_true", help="delete; without it, say what would be deleted"),
    JSON_OPTION,
)
def run_delete(arguments: argparse.Namespace) -> int:
    """Delete what the rule names."""
    require_extra("archive")
    from gateway.archive.deletion import DeletionRule, delete, delete_names, due
    from gateway.archive.source import open_source
    from gateway.archive.tables import Archive
    from gateway.cli.output import show

    source, archive = open_source(arguments.source), Archive(arguments.table)
    rule = DeletionRule(arguments.before, arguments.crane)
    if not arguments.yes:
        files = [file for file in due(archive, rule) if file.row.status != "deleted"]
        what = "would name nobody any more in the tables" if arguments.names else "would be deleted"
        show(_text(files, f"{what}; nothing was done, for want of --yes"), _as_json(files), arguments.json)
        return 0
    why = f"deleted {datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} by {arguments.by}: {arguments.because}"
    if arguments.names:
        rows = delete_names(archive, rule, why)
        show(f"{rows} rows name nobody any more", {"emptied_rows": rows}, arguments.json)
    else:
        files = delete(archive, source, rule, why)
        show(_text(files, "deleted"), _as_json(files), arguments.json)
    return 0


def _text(files: "Sequence[IndexedFile]", what: str) -> str:
    size_mb = sum(file.row.size_bytes for file in files) / 1e6
    return "\n".join([*(file.row.path for file in files), f"{len(files)} recordings ({size_mb:.1f} MB) {what}"])


def _as_json(files: "Sequence[IndexedFile]") -> dict[str, Any]:
    return {"recordings": [{"path": file.row.path, "recording": file.recording} for file in files]}
