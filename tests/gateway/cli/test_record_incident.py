"""`plumbline record incident` with input that it cannot use: one line, exit code 2, no folder left behind."""

from pathlib import Path

import pytest
from mcap.writer import Writer

from gateway.cli.main import main


def write_foreign(path: Path) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema_id = writer.register_schema("Other", "jsonschema", b'{"type":"object"}')
        channel_id = writer.register_channel("/other", "json", schema_id)
        writer.add_message(channel_id, log_time=10**18, data=b"{}", publish_time=10**18)
        writer.finish()


def run(arguments: list[str | Path], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, list[str]]:
    code = main(["record", "incident", *map(str, arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err.strip().splitlines()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("none.mcap", None, "no such file"),
        ("empty.mcap", b"", "is empty"),
        ("text.mcap", b"ax_g,ay_g\n" * 100, "is not an MCAP file"),
        ("magic.mcap", b"\x89MCAP0\r\n", "has no message"),
        ("torn.mcap", b"\x89MCAP0\r\n" + bytes(range(256)) * 8, "has no message"),
    ],
)
@pytest.mark.parametrize("choice", [[], ["--last"], ["--alert", "1"], ["--around", "10"], ["--from", "1", "--to", "2"]])
def test_a_file_that_is_no_recording_is_refused(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    content: bytes | None,
    expected: str,
    choice: list[str],
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    code, out, err = run([path, *choice, "--out", tmp_path / "report"], capsys)
    assert code == 2
    assert out == ""
    assert len(err) == 1
    assert name in err[0]
    assert expected in err[0]
    assert [each.name for each in tmp_path.iterdir()] == ([] if content is None else [name])


@pytest.mark.slow
@pytest.mark.parametrize("choice", [[], ["--last"], ["--alert", "1"], ["--around", "10"]])
def test_a_recording_of_another_program_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], choice: list[str]
) -> None:
    write_foreign(tmp_path / "foreign.mcap")
    code, out, err = run([tmp_path / "foreign.mcap", *choice, "--out", tmp_path / "report"], capsys)
    assert (code, out, len(err)) == (2, "", 1)
    assert "foreign.mcap" in err[0]
    assert [each.name for each in tmp_path.iterdir()] == ["foreign.mcap"]


def test_an_empty_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run([tmp_path, "--last"], capsys)
    assert (code, len(err)) == (2, 1)
    assert "contains no .mcap file" in err[0]


def test_an_interval_and_a_choice_exclude_each_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run([tmp_path, "--last", "--from", "1"], capsys)
    assert (code, len(err)) == (2, 1)
    assert "--from and --to: take the place of --around, --alert, --last and --list" in err[0]
