"""The rows of an archive that count, to compare archives."""

import subprocess
import sys
from pathlib import Path
from typing import Any

from gateway.archive.admission import known_key, read_keys
from gateway.archive.index import IndexResult, index
from gateway.archive.query import open_database
from gateway.archive.rows import RECORDINGS, TABLES
from gateway.archive.source import open_source
from gateway.archive.tables import Archive
from tests.gateway.archive.small_recordings import SmallCrane


def indexed(source: Path, table: Path, keys: Path | None = None) -> IndexResult:
    return index(open_source(str(source)), Archive(str(table)), known_key if keys is None else read_keys(keys))


def index_process(source: Path, table: Path, keys: Path) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "gateway", "archive", "index", source, "--into", table, "--keys", keys]
    return subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def keys_file(path: Path, *cranes: SmallCrane) -> Path:
    path.write_text("".join(f"{crane.gateway}  {crane.public_key}\n" for crane in cranes))
    return path


def content(table: Path) -> dict[str, list[str]]:
    """Every row that counts, and the files with their status; what a store says of a file's version is its own."""
    chosen = dict.fromkeys(TABLES, "*") | {RECORDINGS: "* EXCLUDE (version)"}
    with open_database(Archive(str(table))) as database:
        return {
            name: sorted(map(repr, database.execute(f"SELECT {columns} FROM {name}").fetchall()))
            for name, columns in chosen.items()
        }


def select(table: Path, sql: str) -> list[tuple[Any, ...]]:
    """Rows of an answer, without the question of what is verified."""
    with open_database(Archive(str(table))) as database:
        return database.execute(sql).fetchall()
