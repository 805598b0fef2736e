"""Index runs as real processes: killed at any moment, and several at once. The rows are those of a single clean run."""

import time
from pathlib import Path

import pytest

from tests.gateway.archive.archive_rows import content, index_process, select
from tests.gateway.archive.small_recordings import SmallCrane
from tests.waiting import PATIENCE_S


def finish(source: Path, table: Path, keys: Path) -> None:
    process = index_process(source, table, keys)
    said, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, said


@pytest.mark.slow
def test_runs_at_once_give_the_rows_of_one(fleet: list[SmallCrane], keys: Path, clean: Path, tmp_path: Path) -> None:
    source = fleet[0].folder.parent
    processes = [index_process(source, tmp_path / "table", keys) for _ in range(3)]
    said = [process.communicate(timeout=PATIENCE_S)[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0], said
    assert content(tmp_path / "table") == content(clean)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_a_killed_run_leaves_nothing_that_counts_twice_or_is_lost(
    share: float, fleet: list[SmallCrane], keys: Path, clean: Path, tmp_path: Path
) -> None:
    """Killed once after each share of the transactions, by the number of those that are there."""
    source, table = fleet[0].folder.parent, tmp_path / "table"
    expected = content(clean)
    wanted = round(share * transactions(clean))
    process = index_process(source, table, keys)
    while transactions(table) < wanted and process.poll() is None:
        time.sleep(0.001)
    process.kill()
    process.communicate()
    if (table / "results" / "_delta_log" / "00000000000000000000.json").exists():
        counted = {row[0] for row in select(table, "SELECT recording FROM recordings WHERE status = 'counted'")}
        assert len(counted) % 3 == 0  # the transaction of a crane has all or nothing
    finish(source, table, keys)
    assert content(table) == expected


def transactions(table: Path) -> int:
    return len(list(table.glob("*/_delta_log/*.json")))
