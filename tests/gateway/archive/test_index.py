"""The index has what the recordings have, each row once, and says of each what it is worth.

So it is with real processes too, killed at any moment, and several at once.
"""

import shutil
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from deltalake import DeltaTable, write_deltalake

from gateway.archive import index as index_module
from gateway.archive.rows import RECORDINGS, TABLES, schema_of
from gateway.cli.main import main
from gateway.errors import BAD_INPUT, WITH_LOSSES
from gateway.messages import Motion
from gateway.recording.segments.copying import recover
from tests.clocks import START_NS
from tests.gateway.archive.small_recordings import (
    NS_PER_S,
    SmallCrane,
    content,
    index_process,
    indexed,
    keys_file,
    select,
)
from tests.gateway.recorded_crane import RecordedCrane
from tests.waiting import PATIENCE_S


def versions(table: Path) -> dict[str, int]:
    return {name: DeltaTable(str(table / name)).version() for name in (*TABLES, RECORDINGS)}


def statuses(table: Path) -> dict[str, str]:
    return dict(select(table, "SELECT path, status FROM recordings"))


def reasons(table: Path) -> dict[str, str]:
    return dict(select(table, "SELECT path, reason FROM recordings WHERE status = 'refused'"))


@pytest.mark.slow
def test_the_tables_have_what_the_pipeline_has_sent(recorded: RecordedCrane, tmp_path: Path) -> None:
    indexed(recorded.folder, tmp_path / "table")
    largest = recorded.largest
    assert select(tmp_path / "table", "SELECT max(angle_max_deg) FROM motion") == [(round(largest.angle_deg or 0, 3),)]
    ((seconds, known),) = select(tmp_path / "table", "SELECT sum(seconds), sum(known_s) FROM minutes")
    assert seconds == 49  # each of the four borders between files falls into a second, which is in both
    sent = [each.message for each in recorded.messages if isinstance(each.message, Motion)]
    assert known == pytest.approx(sum(each.angle_deg is not None for each in sent) / 10, abs=4)
    incidents = select(tmp_path / "table", "SELECT incident, rule, level FROM alerts ORDER BY utc")
    assert incidents[0] == ("b00t-1", "swing", "trip")
    assert {incident[:2] for incident in incidents} == {("b00t-1", "swing")}  # a part in each file
    (record,) = select(tmp_path / "table", "SELECT DISTINCT record FROM calibrations")
    assert '"method":"factory"' in record[0]


@pytest.mark.slow
def test_the_motion_of_each_second_has_its_extremes(fleet: list[SmallCrane], clean: Path) -> None:
    angles_deg = [each.angle_deg for each in fleet[0].sent if each.angle_deg is not None]
    found = select(
        clean, "SELECT angle_max_deg, upper_max_deg FROM motion WHERE crane = 'crane-1' AND known_count ORDER BY utc"
    )
    assert [each[0] for each in found] == pytest.approx(angles_deg, abs=1e-3)
    assert found[0][1] == pytest.approx(angles_deg[0] + 1.96 * 0.1, abs=1e-3)


@pytest.mark.slow
def test_a_swing_counts_once_in_each_period(clean: Path) -> None:
    ((count, phi_max_deg),) = select(clean, "SELECT count(*), max(phi_max_deg) FROM swings WHERE crane = 'crane-3'")
    assert count == 12  # 57 s of swings of 5 s; a period ends with its segment
    assert phi_max_deg == 8.0


@pytest.mark.slow
def test_conditions_are_spans_with_the_reason_without_its_numbers(clean: Path) -> None:
    found = select(
        clean,
        "SELECT verdict, validity, reason, sum(duration_s) FROM conditions WHERE crane = 'crane-1' GROUP BY ALL ORDER BY 4",
    )
    assert ("unknown", "not_known", "only # s of data", 1.0) in found
    assert sum(row[3] for row in found) == 3 * 19 - 1  # of each segment from the first to the last condition


@pytest.mark.slow
def test_every_row_says_whether_its_recording_is_verified(
    fleet: list[SmallCrane], keys: Path, clean: Path, tmp_path: Path
) -> None:
    indexed(fleet[0].folder, tmp_path / "without")
    for name in (*TABLES, RECORDINGS):
        assert select(clean, f"SELECT DISTINCT trust FROM {name}") == [("verified",)]
        assert select(tmp_path / "without", f"SELECT DISTINCT trust FROM {name}") == [("consistent",)]
    indexed(fleet[0].folder, tmp_path / "without", keys)
    assert select(tmp_path / "without", "SELECT DISTINCT trust FROM motion") == [("verified",)]


def test_a_second_run_reads_and_writes_nothing(fleet: list[SmallCrane], keys: Path, clean: Path) -> None:
    before = versions(clean)
    assert indexed(fleet[0].folder.parent, clean, keys).read == []
    assert versions(clean) == before


@pytest.mark.slow
def test_what_is_new_is_added_alone(fleet: list[SmallCrane], keys: Path, clean: Path, tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(fleet[0].folder.parent, source)
    late = [source / "crane-2" / fleet[1].files[0].name, source / "crane-3" / fleet[2].files[2].name]
    for path in late:
        path.rename(path.with_suffix(".later"))
    indexed(source, tmp_path / "table", keys)
    for path in late:
        path.with_suffix(".later").rename(path)
    assert len(indexed(source, tmp_path / "table", keys).read) == len(late)
    assert content(tmp_path / "table") == content(clean)


@pytest.mark.slow
def test_a_segment_that_was_uploaded_twice_counts_once(fleet: list[SmallCrane], keys: Path, tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(fleet[0].folder, source)
    indexed(source, tmp_path / "table", keys)
    before = content(tmp_path / "table")
    shutil.copy(fleet[0].files[1], source / "again.mcap")
    indexed(source, tmp_path / "table", keys)
    after = content(tmp_path / "table")
    assert {name: rows for name, rows in after.items() if name != RECORDINGS} == {
        name: rows for name, rows in before.items() if name != RECORDINGS
    }
    assert statuses(tmp_path / "table")["again.mcap"] == "counted"  # of equal files the first name
    assert statuses(tmp_path / "table")[fleet[0].files[1].name] == "copy"
    indexed(source, tmp_path / "clean", keys)
    assert after == content(tmp_path / "clean")


@pytest.mark.slow
def test_a_segment_that_was_completed_later_replaces_its_beginning(tmp_path: Path) -> None:
    """A power failure cuts the segment off; the gateway repairs and signs it at its next start, and it is uploaded again."""
    crane = SmallCrane(tmp_path / "crane", segments=1, closed=False).record()
    source, table = tmp_path / "source", tmp_path / "table"
    source.mkdir()
    keys = keys_file(tmp_path / "keys.txt", crane)
    shutil.copy(crane.files[0], source / "upload-1.mcap")
    indexed(source, table, keys)
    assert select(table, "SELECT DISTINCT trust FROM motion") == [("unsigned",)]
    crane.repair()
    shutil.copy(crane.files[0], source / "upload-2.mcap")
    indexed(source, table, keys)
    assert statuses(table) == {"upload-1.mcap": "superseded", "upload-2.mcap": "counted"}
    assert select(table, "SELECT count(*), count(DISTINCT utc), min(trust) FROM motion") == [(19, 19, "verified")]
    indexed(source, tmp_path / "clean", keys)
    assert content(table) == content(tmp_path / "clean")


@pytest.mark.slow
def test_a_writer_that_is_overtaken_begins_again_and_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between its look at the files and its rows, another run indexes the repaired segment, which replaces the cut one."""
    crane = SmallCrane(tmp_path / "crane", segments=1, closed=False).record()
    source, table = tmp_path / "source", tmp_path / "table"
    source.mkdir()
    shutil.copy(crane.files[0], source / "upload-1.mcap")
    crane.repair()
    exchange_rows = index_module._exchange_rows
    overtaken: list[bool] = []

    def be_overtaken(*arguments: Any) -> None:
        if not overtaken:
            overtaken.append(True)
            shutil.copy(crane.files[0], source / "upload-2.mcap")
            indexed(source, table)
        exchange_rows(*arguments)

    monkeypatch.setattr(index_module, "_exchange_rows", be_overtaken)
    (late,) = indexed(source, table).read
    assert late.row.status == "superseded"
    assert select(table, "SELECT count(*), count(DISTINCT recording) FROM all_motion") == [(19, 1)]
    assert select(table, "SELECT count(*) FROM motion") == [(19,)]


@pytest.mark.slow
def test_a_recovered_copy_counts_only_while_nothing_signed_is_there(
    fleet: list[SmallCrane], keys: Path, tmp_path: Path
) -> None:
    source = tmp_path / "source"
    source.mkdir()
    recover(fleet[0].files[0], source / "a.recovered.mcap")
    indexed(source, tmp_path / "table", keys)
    assert select(tmp_path / "table", "SELECT DISTINCT trust FROM motion") == [("unsigned",)]
    shutil.copy(fleet[0].files[0], source / "b.mcap")
    indexed(source, tmp_path / "table", keys)
    assert statuses(tmp_path / "table") == {"a.recovered.mcap": "superseded", "b.mcap": "counted"}
    assert select(tmp_path / "table", "SELECT DISTINCT trust FROM motion") == [("verified",)]


@pytest.mark.slow
def test_a_clock_that_is_an_hour_wrong_makes_no_row_count_twice_or_vanish(tmp_path: Path) -> None:
    """A start at the right time, then one whose clock is an hour behind: both say that they recorded the same minute."""
    hour_ns = 3600 * NS_PER_S
    source = tmp_path / "source"
    right = SmallCrane(source / "right", segments=2).record()
    SmallCrane(source / "wrong", segments=2, start_ns=START_NS + hour_ns, wall_offset_ns=-hour_ns).record()
    indexed(source, tmp_path / "table")
    ((rows, times, gateway_times),) = select(
        tmp_path / "table", "SELECT count(*), count(DISTINCT utc), count(DISTINCT gateway_time_ns) FROM motion"
    )
    assert (rows, times, gateway_times) == (2 * len(right.sent), len(right.sent), 2 * len(right.sent))
    indexed(source / "wrong", tmp_path / "other")
    indexed(source / "right", tmp_path / "other")
    assert content(tmp_path / "other")["motion"] == content(tmp_path / "table")["motion"]


@pytest.mark.slow
def test_a_growing_file_is_read_again(fleet: list[SmallCrane], keys: Path, tmp_path: Path) -> None:
    source, whole = tmp_path / "source", fleet[0].files[0].read_bytes()
    source.mkdir()
    for share in (0.4, 0.7, 1.0):
        (source / "live.mcap").write_bytes(whole[: int(share * len(whole))])
        indexed(source, tmp_path / "table", keys)
    indexed(source, tmp_path / "clean", keys)
    assert content(tmp_path / "table") == content(tmp_path / "clean")


@pytest.mark.slow
def test_damaged_forged_and_foreign_files_are_listed_and_do_not_stop_the_rest(
    fleet: list[SmallCrane], keys: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "source"
    shutil.copytree(fleet[0].folder, source)
    flipped = bytearray(fleet[0].files[1].read_bytes())
    flipped[len(flipped) // 2] ^= 1
    (source / "flipped.mcap").write_bytes(flipped)
    (source / "empty.mcap").write_bytes(b"")
    (source / "text.mcap").write_text("no recording at all")
    SmallCrane(source / "forged", peak_deg=1.0, segments=1).record()
    other = SmallCrane(source / "other", "crane-9", segments=1).record()
    arguments = ["archive", "index", str(source), "--into", str(tmp_path / "table"), "--keys", str(keys)]
    assert main(arguments) == WITH_LOSSES
    printed = capsys.readouterr().out
    found = reasons(tmp_path / "table")
    assert {path.rpartition("/")[2] for path in found} == {
        "flipped.mcap",
        "empty.mcap",
        "text.mcap",
        (source / "forged").glob("*.mcap").__next__().name,
    }
    assert "ALTERED" in found["flipped.mcap"]
    assert any("WRONG KEY" in reason for reason in found.values())
    assert all(reason and reason in printed for reason in found.values())
    rows = select(tmp_path / "table", "SELECT crane, trust, max(phi_max_deg) FROM swings GROUP BY ALL ORDER BY 1")
    assert rows == [("crane-1", "verified", 6.0), ("crane-9", "consistent", other.peak_deg)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start_ns", "wall_offset_ns", "reason"),
    [(2**62 + 1, 0, "has no message of the last decades"), (START_NS, 2**62, "states a clock that is decades wrong")],
)
def test_times_that_no_gateway_has_are_refused(start_ns: int, wall_offset_ns: int, reason: str, tmp_path: Path) -> None:
    SmallCrane(tmp_path / "source", segments=1, start_ns=start_ns, wall_offset_ns=wall_offset_ns).record()
    indexed(tmp_path / "source", tmp_path / "table")
    (found,) = reasons(tmp_path / "table").values()
    assert found.startswith(reason)


@pytest.mark.slow
def test_a_recording_that_is_signed_for_another_crane_is_refused(tmp_path: Path) -> None:
    """Whoever has the key of one gateway cannot speak for another one."""
    thief = SmallCrane(tmp_path / "source", "crane-1", segments=1)
    thief.__class__ = type("Thief", (SmallCrane,), {"gateway": property(lambda self: "yard/crane-2/hook")})
    thief.record()
    indexed(tmp_path / "source", tmp_path / "table")
    (reason,) = reasons(tmp_path / "table").values()
    assert reason == "forged: says that it is of yard/crane-1/hook, and is signed for yard/crane-2/hook"


@pytest.mark.slow
def test_a_wrong_key_file_can_be_put_right(fleet: list[SmallCrane], keys: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.txt"
    wrong.write_text(f"{fleet[0].gateway}  {fleet[1].public_key}\n")
    indexed(fleet[0].folder, tmp_path / "table", wrong)
    assert set(statuses(tmp_path / "table").values()) == {"refused"}
    indexed(fleet[0].folder, tmp_path / "table", keys)
    assert select(tmp_path / "table", "SELECT count(*) FROM recordings WHERE trust = 'verified'") == [(3,)]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["nowhere", "--into", "t"],
            "nowhere: is no folder; give one with recordings, or a URL such as s3://bucket/prefix",
        ),
        (["gs2://x", "--into", "t"], "gs2://x: is no object store that can be used"),
        ([".", "--into", "t", "--keys", "none.txt"], "none.txt: cannot be read"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["archive", "index", *arguments]) == BAD_INPUT
    printed = capsys.readouterr().err
    assert said in printed
    assert printed.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_table_of_an_older_version_gets_the_new_columns(fleet: list[SmallCrane], keys: Path, tmp_path: Path) -> None:
    table = tmp_path / "table"
    schema = schema_of("swings")
    older = schema.remove(schema.get_field_index("lean_deg"))
    DeltaTable.create(str(table / "swings"), older, partition_by=["crane", "from_month"])
    write_deltalake(
        str(table / "swings"),
        pa.table({"crane": ["crane-1"], "from_month": ["2025-12"], "recording": ["before"]}, older_part(older)),
        mode="append",
        schema_mode="merge",
    )
    indexed(fleet[0].folder, table, keys)
    assert select(table, "SELECT count(*), count(lean_deg) FROM all_swings") == [(13, 0)]  # no swing here has a lean
    assert select(table, "SELECT count(*) FROM swings") == [(12,)]


def older_part(schema: pa.Schema) -> pa.Schema:
    return pa.schema([schema.field(name) for name in ("crane", "from_month", "recording")])


@pytest.mark.slow
def test_small_files_are_joined_and_the_rows_stay(fleet: list[SmallCrane], keys: Path, tmp_path: Path) -> None:
    source, table = tmp_path / "source", tmp_path / "table"
    source.mkdir()
    for path in fleet[0].files:
        shutil.copy(path, source)
        indexed(source, table, keys)
    before = content(table)
    assert len(DeltaTable(str(table / "motion")).file_uris()) == 3
    assert main(["archive", "index", str(source), "--into", str(table), "--keys", str(keys), "--compact"]) == 0
    assert len(DeltaTable(str(table / "motion")).file_uris()) == 1
    assert content(table) == before


@pytest.mark.slow
def test_times_are_utc(clean: Path) -> None:
    ((first,),) = select(clean, "SELECT min(utc) FROM motion")
    assert first == datetime(2026, 1, 1, tzinfo=UTC)


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
