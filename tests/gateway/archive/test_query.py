"""Questions in SQL see the rows that count and nothing else, and every answer says what rests on doubtful recordings."""

import json
import shutil
from pathlib import Path

import pytest

from gateway.archive.query import ask
from gateway.archive.rows import TABLES
from gateway.archive.tables import Archive
from gateway.cli.main import main
from gateway.errors import BAD_INPUT, InputError
from tests.gateway.archive.small_recordings import SmallCrane, indexed, select


@pytest.fixture(scope="module")
def mixed(fleet: list[SmallCrane], keys: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Crane 1 is verified; of crane 9, which swings further, no key is known."""
    folder = tmp_path_factory.mktemp("mixed")
    shutil.copytree(fleet[0].folder, folder / "source" / "crane-1")
    SmallCrane(folder / "source" / "crane-9", "crane-9", peak_deg=9.0, segments=1).record()
    indexed(folder / "source", folder / "table", keys)
    return folder / "table"


@pytest.mark.slow
def test_rows_of_an_answer_that_rest_on_doubtful_recordings_are_marked(mixed: Path) -> None:
    answer = ask(Archive(str(mixed)), "SELECT crane, max(phi_max_deg) FROM swings GROUP BY crane ORDER BY crane")
    assert answer.rows == (("crane-1", 6.0), ("crane-9", 9.0))
    assert answer.is_verified == (True, False)
    assert answer.trust == {"consistent": 1, "verified": 3}


@pytest.mark.slow
def test_a_number_over_everything_is_marked_if_one_doubtful_recording_changes_it(mixed: Path) -> None:
    assert ask(Archive(str(mixed)), "SELECT max(phi_max_deg) FROM swings").is_verified == (False,)
    assert ask(Archive(str(mixed)), "SELECT min(phi_max_deg) FROM swings").is_verified == (True,)
    only = ask(Archive(str(mixed)), "SELECT max(phi_max_deg) FROM swings", verified_only=True)
    assert (only.rows, only.is_verified) == (((6.0,),), (True,))


@pytest.mark.slow
def test_the_printed_answer_has_the_marks(mixed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sql = "SELECT crane, min(utc) AS first FROM swings GROUP BY crane ORDER BY crane"
    assert main(["archive", "query", sql, "--table", str(mixed)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line[:9] for line in lines[:3]] == ["  crane  ", "  crane-1", "* crane-9"]
    assert lines[3] == "2 rows from 1 consistent, 3 verified; * rests on recordings that are not verified (1 rows)"
    assert main(["archive", "query", sql, "--table", str(mixed), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["is_verified"] == [True, False]
    assert found["rows"][0] == ["crane-1", "2026-01-01T00:00:02+00:00"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "sql",
    [
        "SELECT 1; SELECT 2",
        "COPY motion TO 'stolen.csv'",
        "SELECT * FROM 'secret.csv'",
        "SELECT * FROM read_text('{folder}/secret.csv')",
        "SET enable_external_access = true",
        "ATTACH 'other.db'",
        "SELEC",
        "",
    ],
)
def test_only_a_question_to_the_tables_is_answered(
    sql: str, clean: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError):
        ask(Archive(str(clean)), sql.format(folder=tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["secret.csv"]


def test_a_place_without_tables_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["archive", "query", "SELECT 1", "--table", str(tmp_path / "none")]) == BAD_INPUT
    assert "has no table swings; make it with plumbline archive index" in capsys.readouterr().err


@pytest.mark.slow
def test_a_place_with_special_characters_is_read(fleet: list[SmallCrane], tmp_path: Path) -> None:
    for name in ("größe 7", "a'b", "a=b,c&d"):
        indexed(fleet[0].folder, tmp_path / name / "table")
        assert select(tmp_path / name / "table", "SELECT crane, count(*) FROM motion GROUP BY crane") == [
            ("crane-1", 59)
        ]


@pytest.mark.parametrize("name", ["7%20", "[x]", "what?"])
def test_a_place_that_the_tables_cannot_have_is_one_line(
    name: str, fleet: list[SmallCrane], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["archive", "index", str(fleet[0].folder), "--into", str(tmp_path / name)]) == BAD_INPUT
    assert "in its name; choose one without" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_empty_archive_has_empty_tables(tmp_path: Path) -> None:
    (tmp_path / "source").mkdir()
    indexed(tmp_path / "source", tmp_path / "table")
    assert [select(tmp_path / "table", f"SELECT count(*) FROM {name}") for name in TABLES] == [[(0,)]] * len(TABLES)
