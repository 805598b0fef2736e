"""What an archive costs: indexing by the number of recordings, and a report over a month of many cranes.

script/bench archive [--cranes N] [--days N] [--recordings N]: the report is of synthetic minutes, the recordings are small ones.
"""

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pyarrow as pa

from gateway.archive.admission import known_key
from gateway.archive.compute import Workers, compute
from gateway.archive.index import index
from gateway.archive.query import ask
from gateway.archive.report import ReportQuestion, make_report
from gateway.archive.report_page import render_archive_report
from gateway.archive.rows import RECORDINGS, schema_of
from gateway.archive.source import open_source
from gateway.archive.tables import Archive, row_places
from gateway.archive.tasks import TaskLimits, TaskOutcome
from tests.clocks import START_NS
from tests.gateway.archive.small_recordings import SmallCrane

BEGIN = datetime(2026, 1, 1, tzinfo=UTC)
SEGMENT_MINUTES = 10
MINUTES_PER_DAY = 1440
NS_PER_MINUTE = 60_000_000_000
QUESTION = "SELECT crane, calibration_id, max(phi_max_deg) FROM swings WHERE phi_max_deg > 5 GROUP BY ALL"


def main(options: Sequence[str] = ()) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cranes", type=int, default=100)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--recordings", type=int, default=1000)
    chosen = parser.parse_args(options)
    print(f"archive: load {os.getloadavg()[0]:.0f}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        _report(Path(folder), chosen.cranes, chosen.days)
    with tempfile.TemporaryDirectory() as folder:
        _grow(Path(folder), chosen.recordings, chosen.cranes)


def _report(folder: Path, cranes: int, days: int) -> None:
    archive = Archive(str(folder))
    archive.create()
    for number in range(cranes):
        _write_crane(archive, f"crane-{number}", days, np.random.default_rng(number))
    size_mb = sum(path.stat().st_size for path in folder.rglob("*.parquet")) / 1e6
    begin_s, cpu_s = time.perf_counter(), time.process_time()
    report = make_report(archive, ReportQuestion(BEGIN, BEGIN + timedelta(days=days), 5.0), BEGIN)
    page = render_archive_report(report, "/srv/recordings")
    print(
        f"report of {cranes} cranes and {days} days ({size_mb:.0f} MB of tables): {time.perf_counter() - begin_s:.1f} s, "
        f"{time.process_time() - cpu_s:.1f} s of CPU, {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} MB at most, "
        f"page of {len(page) / 1e3:.0f} kB",
        flush=True,
    )


def _write_crane(archive: Archive, crane: str, days: int, rng: np.random.Generator) -> None:
    """Write minutes, conditions and health of every minute, and the recordings."""
    count = days * MINUTES_PER_DAY
    utc_ns = int(BEGIN.timestamp()) * 10**9 + np.arange(count) * NS_PER_MINUTE
    recordings = [f"{crane}-{number:060d}" for number in range(count // SEGMENT_MINUTES)]
    angle_deg = rng.gamma(2.0, 0.8, count)
    common: dict[str, Any] = {
        "site": ["yard"] * count,
        "crane": [crane] * count,
        "sensor": ["hook"] * count,
        "recording": [each for each in recordings for _ in range(SEGMENT_MINUTES)],
        "trust": ["verified"] * count,
        "utc": utc_ns // 1000,
        "gateway_time_ns": utc_ns,
        "from_month": [f"{datetime.fromtimestamp(each / 1e9, UTC):%Y-%m}" for each in utc_ns],
    }
    minutes = {
        "seconds": np.full(count, 60),
        "known_s": rng.uniform(55, 60, count),
        "angle_max_deg": angle_deg,
        "upper_max_deg": angle_deg + rng.uniform(0.1, 0.6, count),
        "largest_utc": utc_ns // 1000,
    }
    validity = rng.choice(["valid", "not_known", "no_samples"], count, p=[0.97, 0.02, 0.01]).tolist()
    conditions = {"duration_s": np.full(count, 60.0), "verdict": ["swinging"] * count, "validity": validity}
    health: dict[str, Any] = {"device_id": [f"part-{crane}"] * count, "drift_state": ["watching"] * count}
    health |= {"drift_norm_error_mg": rng.normal(0, 1, count)}
    files = {
        "path": [f"{each}.mcap" for each in recordings],
        "status": ["counted"] * len(recordings),
        "end_utc": (utc_ns[::SEGMENT_MINUTES] + SEGMENT_MINUTES * NS_PER_MINUTE) // 1000,
    }
    first = {name: values[::SEGMENT_MINUTES] for name, values in common.items()}
    for name, columns in (
        ("minutes", common | minutes),
        ("conditions", common | conditions),
        ("health", common | health),
        (RECORDINGS, first | files),
    ):
        rows = _table(name, columns)
        archive.exchange(name, row_places(name, [f"yard/{crane}/hook"], [], []), rows)


def _table(name: str, columns: dict[str, Any]) -> pa.Table:
    schema = schema_of(name)
    count = len(columns["utc"])
    arrays = [
        pa.array(columns[field.name], field.type) if field.name in columns else pa.nulls(count, field.type)
        for field in schema
    ]
    return pa.table(arrays, schema=schema)


def _grow(folder: Path, recordings: int, cranes: int) -> None:
    """Put ever more recordings, one a day and crane, into one archive, and print what each of them costs."""
    archive = Archive(str(folder / "table"))
    source = folder / "source"
    for done, wanted in pairwise([0, *(10**power for power in range(1, 9) if 10**power < recordings), recordings]):
        with patch("os.fsync"):  # nobody asks for these files after a power failure
            for number in range(done, wanted):
                _record(source, *divmod(number, cranes))
        costs = {
            "index": _cost(lambda: index(open_source(str(source)), archive, known_key), wanted - done),
            "nothing new": _cost(lambda: index(open_source(str(source)), archive, known_key), wanted),
        }
        archive.compact()
        costs["query"] = _cost(lambda: ask(archive, QUESTION), wanted)
        end = BEGIN + timedelta(days=wanted // cranes + 1)
        costs["report"] = _cost(partial(make_report, archive, ReportQuestion(BEGIN, end, 5.0), end), wanted)
        with patch("gateway.archive.compute.run_task", return_value=TaskOutcome("done", "equal", "", "{}")):
            costs["replay without the command"] = _cost(
                lambda: compute(archive, str(source), "replay", Workers(2), TaskLimits()), wanted - done
            )
        told = ", ".join(
            f"{name} {total_s:.2f} s ({each_ms:.1f} ms each)" for name, (total_s, each_ms) in costs.items()
        )
        memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        print(f"{wanted} recordings, {wanted - done} new: {told}; {memory_mb:.0f} MB at most", flush=True)
    size_kb = sum(path.stat().st_size for path in (folder / "table").rglob("*.parquet")) / 1e3 / recordings
    print(f"tables: {size_kb:.1f} kB a recording, with what the next weeks delete", flush=True)


def _record(source: Path, day: int, crane: int) -> None:
    """Record ten seconds of a crane: the key and the chain of its folder go on."""
    start_ns = START_NS + day * 1440 * NS_PER_MINUTE
    SmallCrane(
        source / f"{crane}", f"crane-{crane}", segments=1, segment_s=10, boot=f"d{day}", start_ns=start_ns
    ).record()


def _cost(work: Callable[[], object], count: int) -> tuple[float, float]:
    """Return seconds of CPU of this process, and milliseconds for each of so many."""
    begin_s = time.process_time()
    work()
    cost_s = time.process_time() - begin_s
    return cost_s, 1e3 * cost_s / count
