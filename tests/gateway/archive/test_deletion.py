"""Recordings are deleted by a rule: rows, answers and files go, and the evidence that they were there stays."""

import json
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import pytest
from deltalake import DeltaTable

from gateway.archive.deletion import DeletionRule
from gateway.archive.rows import RECORDINGS, TABLES
from gateway.archive.tables import Archive
from gateway.cli.main import main
from tests.clocks import START_NS
from tests.gateway.archive.small_recordings import NS_PER_S, SmallCrane, content, indexed, keys_file, select

pytestmark = pytest.mark.slow

DAY_NS = 86_400 * NS_PER_S
NEXT_DAY = "2026-01-02"


@pytest.fixture
def crane(tmp_path: Path) -> SmallCrane:
    """A crane with a start of two segments on each of two days, indexed into `tmp_path / "table"`."""
    folder = tmp_path / "source" / "crane-1"
    record = {"by": "ann"}
    SmallCrane(folder, segments=2, boot="first", calibration=record).record()
    crane = SmallCrane(folder, segments=2, boot="second", start_ns=START_NS + DAY_NS, calibration=record).record()
    indexed(tmp_path / "source", tmp_path / "table", keys_file(tmp_path / "keys.txt", crane))
    return crane


def delete(crane: SmallCrane, *options: str) -> int:
    source = crane.folder.parent
    table = str(source.parent / "table")
    rule = ["--before", NEXT_DAY, "--by", "ann", "--because", "kept for a day", *options]
    return main(["archive", "delete", str(source), "--table", table, *rule])


def test_what_a_rule_deletes_leaves_its_evidence_and_the_chain_after_it_genuine(
    crane: SmallCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, table = crane.folder.parent, tmp_path / "table"
    assert main(["archive", "verify", str(source), "--table", str(table)]) == 0
    before = select(table, "SELECT path, recording, statement_sha256, previous_sha256 FROM recordings ORDER BY path")
    assert delete(crane, "--yes") == 0
    assert "2 recordings" in capsys.readouterr().out
    assert len(crane.files) == 2
    for name in TABLES:
        dates = [day for (day,) in select(table, f"SELECT DISTINCT utc::DATE::VARCHAR FROM all_{name}")]
        assert dates == [NEXT_DAY], name
    assert select(table, "SELECT * FROM results") == []  # an answer that rests on what is gone
    after = select(table, "SELECT path, recording, statement_sha256, previous_sha256 FROM recordings ORDER BY path")
    assert after == before
    found = select(table, "SELECT status, reason FROM recordings ORDER BY path")
    assert [status for status, _ in found] == ["deleted", "deleted", "counted", "counted"]
    assert found[0][1].startswith(f"deleted {datetime.now(UTC):%Y-%m-%dT}")
    assert found[0][1].endswith("by ann: kept for a day")
    joined = [(one[2], other[3]) for one, other in pairwise(after)]
    assert all(statement == previous for statement, previous in joined)  # each names the one before, deleted or not
    assert main(["archive", "verify", str(source), "--table", str(table)]) == 0
    assert select(table, "SELECT verdict FROM results") == [("genuine",)]


def test_a_segment_of_which_a_version_goes_on_after_the_day_stays(clean: Path) -> None:
    (old, *_) = Archive(str(clean)).files(Archive(str(clean)).open(RECORDINGS))
    rule = DeletionRule(datetime(2026, 1, 2, tzinfo=UTC))
    assert rule.chosen([old]) == [old]
    longer = replace(old, recording="repaired", row=replace(old.row, path="z.mcap", end_utc=START_NS + DAY_NS))
    assert rule.chosen([old, longer]) == []


def test_without_yes_nothing_is_deleted(crane: SmallCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = content(tmp_path / "table")
    assert delete(crane) == 0
    assert "2 recordings (0.1 MB) would be deleted; nothing was done, for want of --yes" in capsys.readouterr().out
    assert content(tmp_path / "table") == before
    assert len(crane.files) == 4


def test_what_was_deleted_does_not_come_back(crane: SmallCrane, tmp_path: Path) -> None:
    keys, table = tmp_path / "keys.txt", tmp_path / "table"
    kept = shutil.copytree(crane.folder, tmp_path / "card")
    assert delete(crane, "--yes") == 0
    after = content(table)
    shutil.copytree(kept, crane.folder, dirs_exist_ok=True)  # under the same names
    shutil.copytree(kept, crane.folder.parent / "copies")
    indexed(crane.folder.parent, table, keys)
    for name in TABLES:
        assert content(table)[name] == after[name]
    statuses = select(table, "SELECT status, count(*) FROM recordings GROUP BY ALL ORDER BY 1")
    assert statuses == [("copy", 2), ("counted", 2), ("deleted", 4)]
    assert delete(crane, "--yes") == 0  # and the files that are here again go
    assert len(crane.files) == 2


def test_a_deletion_that_was_ended_before_the_files_went_goes_on(
    crane: SmallCrane, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("gateway.archive.deletion._delete_file", ended)
        assert delete(crane, "--yes") == 130
    assert len(crane.files) == 4
    assert delete(crane, "--yes") == 0
    assert len(crane.files) == 2


def test_another_crane_is_not_touched(crane: SmallCrane, tmp_path: Path) -> None:
    assert delete(crane, "--crane", "crane-2", "--yes") == 0
    assert len(crane.files) == 4
    assert select(tmp_path / "table", "SELECT DISTINCT status FROM recordings") == [("counted",)]


def test_names_go_from_the_tables_and_the_recordings_stay(crane: SmallCrane, tmp_path: Path) -> None:
    source, table = crane.folder.parent, tmp_path / "table"
    assert main(["archive", "verify", str(source), "--table", str(table)]) == 0
    assert delete(crane, "--names", "--yes") == 0
    records = select(table, "SELECT utc::DATE::VARCHAR, record <> '' FROM calibrations GROUP BY ALL ORDER BY 1")
    assert records == [("2026-01-01", False), (NEXT_DAY, True)]
    assert select(table, "SELECT content FROM results WHERE state = 'done'") == [("",)]
    assert len(crane.files) == 4
    last = DeltaTable(str(table / "calibrations")).history(1)[0]
    assert last["why"].endswith("by ann: kept for a day"), json.dumps(last)


def test_names_do_not_come_back_with_a_recording_that_is_read_again(crane: SmallCrane, tmp_path: Path) -> None:
    source, table = crane.folder.parent, tmp_path / "table"
    assert delete(crane, "--names", "--yes") == 0
    for path in crane.files:
        path.rename(path.with_name(f"moved-{path.name}"))
    indexed(source, table)
    records = select(table, "SELECT utc::DATE::VARCHAR, record <> '' FROM calibrations GROUP BY ALL ORDER BY 1")
    assert records == [("2026-01-01", False), (NEXT_DAY, True)]
    assert select(table, "SELECT count(*) FROM all_recordings WHERE nameless <> ''") == [(4,)]


def test_without_yes_no_name_goes(crane: SmallCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = content(tmp_path / "table")
    assert delete(crane, "--names") == 0
    assert "would name nobody any more" in capsys.readouterr().out
    assert content(tmp_path / "table") == before
