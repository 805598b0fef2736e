"""The axes of a recording need nothing else of its configuration, which may be of another version or another program."""

from pathlib import Path

import pytest
from mcap.records import Attachment

from devices.axes_map import SAME_AXES, parse_axes_map
from devices.errors import RecordingError
from gateway.recording.format.content import CONFIGURATION
from gateway.recording.reading.recording_file import RecordingFile
from gateway.recording.reading.sample_calibration import recorded_axes


def recording(configuration: str | None) -> RecordingFile:
    file = RecordingFile(Path("a.mcap"))
    if configuration is not None:
        content = Attachment(0, 0, CONFIGURATION, "application/toml", configuration.encode())
        file.attachments[CONFIGURATION] = content
    return file


@pytest.mark.parametrize(
    ("configuration", "axes"),
    [
        (None, "x,y,z"),
        ("other = 1\n", "x,y,z"),
        ("device = 3\n", "x,y,z"),
        ('[device]\nkind = "of a later version"\naxes_map = "-y,x,z"\n[rope]\nlength_m = -1\n', "-y,x,z"),
    ],
)
def test_the_axes_are_known_whatever_else_the_configuration_has(configuration: str | None, axes: str) -> None:
    assert recorded_axes(recording(configuration)) == (SAME_AXES if axes == "x,y,z" else parse_axes_map(axes))


@pytest.mark.parametrize("configuration", ["not TOML", '[device]\naxes_map = "x,x,z"\n'])
def test_axes_that_are_not_known_are_not_guessed(configuration: str) -> None:
    with pytest.raises(RecordingError, match=r"a\.mcap: its configuration"):
        recorded_axes(recording(configuration))
