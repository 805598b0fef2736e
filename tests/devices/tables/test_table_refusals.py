"""A file that is no CSV recording is refused in one line that names it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from devices.errors import RecordingError
from devices.tables.layout import NATIVE, TableLayout
from devices.tables.native import read_table
from tests.devices.tables.table_lines import HEADER, PHONE, REAL, SIX_POSITION, WriteTable, rows


def test_real_session_by_its_sample_counter_is_refused_for_its_order() -> None:
    """The parts were sorted by name: by the counter, whole faces would fall out."""
    with pytest.raises(
        RecordingError, match=r"six_position_session.csv: .* goes back in 150 of 300 rows; check its time"
    ):
        read_table(REAL / "six_position_session.csv", replace(SIX_POSITION, time="samples"))


@pytest.mark.parametrize(
    ("content", "layout", "message"),
    [
        (b"", NATIVE, "is empty; choose another recording"),
        (b" \n\n", NATIVE, "is empty; choose another recording"),
        (b"\xef\xbb\xbf", NATIVE, "is empty; choose another recording"),
        (b"\x89MCAP0\r\n\x00\x01", NATIVE, "is not UTF-8 text"),
        ("time_s,ax_g\n0,1\n".encode("utf-16"), NATIVE, "is not UTF-8 text"),
        (
            b"t,x,y,z\n0,0,0,1\n",
            NATIVE,
            "no header with the columns time_s, ax_g, ay_g, az_g; its first line has: t, x, y, z",
        ),
        (b"0,0,0,1\n0.1,0,0,1\n", NATIVE, "no header with the columns"),
        (b"time_s,ax_g,ay_g,az_g,ax_g\n0,0,0,1,0\n", NATIVE, "column ax_g occurs twice in its header"),
        (b"time_s,ax_g,ay_g,az_g\n", NATIVE, "no two usable samples in 0 rows; check its columns"),
        (b"time_s,ax_g,ay_g,az_g", NATIVE, "no two usable samples in 0 rows"),
        (b"time_s,ax_g,ay_g,az_g\n0,0,0,1\n1,nan,0,1\n", NATIVE, "no two usable samples in 2 rows"),
        (b"time_s,ax_g,ay_g,az_g\n0;0;0;1\n1;0;0;1\n", NATIVE, "no two usable samples in 2 rows"),
        (
            b"time_s,ax_g,ay_g,az_g\n3,0,0,1\n2,0,0,1\n1,0,0,1\n",
            NATIVE,
            "time repeats in 0 and goes back in 2 of 3 rows; check its time column",
        ),
        (b"0,0,1\n", PHONE, "no line with numbers in the columns 1, 2, 3, 4; its first line has 1: 0,0,1"),
    ],
)
def test_a_file_that_is_not_a_recording_is_refused_in_one_line(
    tmp_path: Path, content: bytes, layout: TableLayout, message: str
) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    with pytest.raises(RecordingError) as refusal:
        read_table(path, layout)
    text = str(refusal.value)
    assert text.startswith(f"{path}: ")
    assert message in text
    assert text.isprintable()


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"gone\.csv: no such file; check the path"):
        read_table(tmp_path / "gone.csv")
    with pytest.raises(RecordingError, match="is a directory; name the recording in it"):
        read_table(tmp_path)


@pytest.mark.parametrize(
    ("error", "message"), [(PermissionError(13, "no"), "may not be read"), (OSError(5, "I/O"), "cannot be read")]
)
def test_a_file_that_cannot_be_read_is_reported(
    table: WriteTable, monkeypatch: pytest.MonkeyPatch, error: OSError | PermissionError, message: str
) -> None:
    path = table(HEADER, *rows(3))

    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("os.open", refuse)
    with pytest.raises(RecordingError, match=message):
        read_table(path)


@pytest.mark.slow
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.binary(max_size=400),
    head=st.sampled_from([b"", b"time_s,ax_g,ay_g,az_g,temperature_c\n0,0,0,1,20\n1,0,0,1,20\n"]),
)
def test_any_bytes_are_read_or_refused(tmp_path: Path, data: bytes, head: bytes) -> None:
    path = tmp_path / "fuzz.csv"
    path.write_bytes(head + data)
    try:
        recording = read_table(path)
    except RecordingError:
        return
    assert np.isfinite(recording.raw).all()
    assert (np.diff(recording.offset_ns()) > 0).all()
