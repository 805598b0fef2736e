"""The example of the guide reads recordings in every state with the public reader."""

import contextlib
import io
import os
import re
import shutil
from pathlib import Path
from textwrap import dedent

import pytest

from tests.gateway.recording.recorded_crane import RecordedCrane

GUIDE = Path(__file__).parents[3] / "docs" / "guides" / "investigator" / "recordings.md"
INCOMPLETE = "the file is incomplete, or still being written"


def example() -> str:
    """The indented block of the section on Python that imports the reader."""
    section = GUIDE.read_text().split("## In Python")[1].split("\n## ")[0]
    (block,) = (each for each in re.findall(r"(?:^ {4}.*\n|^\n)+", section, re.MULTILINE) if "NonSeekingReader" in each)
    return dedent(block)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file that is being written, the same torn, and the same closed."""
    folder = tmp_path_factory.mktemp("data")
    crane = RecordedCrane(folder / "data", segment_s=600.0)
    crane.record(12)
    (path,) = crane.folder.glob("*.mcap")
    live, torn = folder / "live.mcap", folder / "torn.mcap"
    shutil.copy(path, live)
    shutil.copy(path, torn)
    os.truncate(torn, torn.stat().st_size - 1000)
    crane.close()
    return {"live": live, "torn": torn, "closed": path}


@pytest.mark.slow
@pytest.mark.parametrize("state", ["live", "torn", "closed"])
def test_example_of_the_guide_reads_a_recording(
    recordings: dict[str, Path], state: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(recordings[state], tmp_path / "recording.mcap")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(example(), names)
    lines = printed.getvalue().splitlines()
    assert (INCOMPLETE in lines) == (state != "closed")
    swings = [line for line in lines if line != INCOMPLETE]
    assert len(swings) >= 3
    assert len(names["x_counts"]) == 10  # type: ignore[arg-type]
