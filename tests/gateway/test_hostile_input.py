"""Files of every other kind that somebody has made to hurt: refused soon, in one line, and nothing is replaced."""

import os
import stat
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from devices.errors import RecordingError
from devices.tables.layout import read_head
from devices.tables.native import MAX_BYTES, read_table
from gateway.atomic_io import write_durably
from gateway.bench.input_tables import read_columns
from gateway.calibration.input_files import read_parent, read_record
from gateway.calibration.record import CalibrationError
from gateway.calibration.store import CalibrationStore
from gateway.cli.main import main
from gateway.configuration.loading import ConfigurationError, load
from gateway.errors import InputError
from gateway.file_input import DEEP_KEY, MAX_TOML_BYTES, parse_json, parse_toml, read_bounded
from gateway.measurement.rig_file import read_rig
from gateway.outbox import AlertOutbox
from gateway.recalibration.journal import Journal

DEEP = 100_000
TOML = {
    "nested arrays": "a = " + "[" * DEEP,
    "nested tables": "a = " + "{a = " * (DEEP // 3),
    "a number of 5000 digits": "a = " + "9" * 5000,
    "a key of many parts": "a." * DEEP + "a = 1",
    "many deep tables": "\n".join(f"[{'a.' * depth}b]" for depth in range(600)),
    "not UTF-8": "\udcff",
    "large": "# " + "x" * MAX_TOML_BYTES,
}
JSON = {"nested arrays": "[" * DEEP, "nested objects": '{"a":' * DEEP, "long number": "9" * 5000, "not UTF-8": "\udcff"}


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode(errors="surrogateescape"))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("case", TOML)
def test_hostile_toml_is_refused_as_configuration_and_as_rig(tmp_path: Path, case: str) -> None:
    path = written(tmp_path / "a.toml", TOML[case])
    with pytest.raises(ConfigurationError):
        load(path, {})
    with pytest.raises(InputError):
        read_rig(path)


@pytest.mark.parametrize("case", JSON)
def test_hostile_json_is_refused_as_a_record(tmp_path: Path, case: str) -> None:
    path = written(tmp_path / "a.json", JSON[case])
    with pytest.raises(InputError):
        read_record(path)
    with pytest.raises(InputError):
        read_parent(path, "part-7")


@pytest.mark.parametrize("case", JSON)
def test_hostile_state_files_are_reported(tmp_path: Path, case: str) -> None:
    journal = Journal(written(tmp_path / "session.json", JSON[case]))
    assert journal.session is None
    assert journal.read_error is not None
    store = CalibrationStore(tmp_path, "part-7")
    written(store.folder / "in_force.json", JSON[case])
    written(store.folder / "records" / "r1.json", JSON[case])
    with pytest.raises(CalibrationError):
        store.state()
    with pytest.raises(CalibrationError):
        store.record("r1")


READERS: dict[str, tuple[Callable[[Path], object], type[Exception]]] = {
    "configuration": (lambda path: load(path, {}), ConfigurationError),
    "rig": (read_rig, InputError),
    "record": (read_record, InputError),
    "parent": (lambda path: read_parent(path, "part-7"), InputError),
    "bench table": (lambda path: read_columns(path, ("a",)), InputError),
    "table": (read_table, RecordingError),
    "bytes": (read_bounded, OSError),
}


@pytest.mark.parametrize("what", READERS)
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_a_pipe_a_device_and_a_folder_are_refused_at_once(tmp_path: Path, what: str, kind: str) -> None:
    path = {"pipe": tmp_path / "pipe", "device": Path("/dev/zero"), "folder": tmp_path}[kind]
    if kind == "pipe":
        os.mkfifo(path)
    read, expected = READERS[what]
    with pytest.raises(expected):
        read(path)


def test_the_begin_of_a_pipe_is_no_table(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert read_head(tmp_path / "pipe").rows == ()


def test_a_table_that_does_not_fit_into_memory_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "time_s,ax_g,ay_g,az_g\n" + "0,0,0,1\n" * 100)
    os.truncate(path, MAX_BYTES + 1)
    with pytest.raises(RecordingError, match="cut it into parts"):
        read_table(path)


@pytest.mark.parametrize(
    "text",
    [
        '[page]\nlisten = "127.0.0.1:99999"\n',
        '[gateway]\ndata_dir = "a\\u0000b"\n',
        "[recorder]\npre_event_s = 1e300\n",
        "[recorder]\npost_event_s = 1e300\n",
        "[recorder]\nquota_mb = 1e300\n",
        "[device]\nrange_g = 1e-300\n",
    ],
)
def test_impossible_values_are_refused_with_their_key(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigurationError, match=text.split("\n")[1].split(" ", maxsplit=1)[0]):
        load(written(tmp_path / "a.toml", text), {})


@pytest.mark.parametrize("device", [Path("/dev/full"), Path("/dev/null")])
def test_an_output_never_takes_the_place_of_a_device(device: Path) -> None:
    before = device.stat()
    with pytest.raises(OSError, match="is a device or a pipe"):
        write_durably(device, b"{}")
    after = device.stat()
    assert (after.st_mode, after.st_rdev) == (before.st_mode, before.st_rdev)
    assert stat.S_ISCHR(after.st_mode)


def test_an_outbox_of_noise_has_no_changes_and_goes_on(tmp_path: Path) -> None:
    written(tmp_path / "changes-00000000.log", "".join(map(chr, range(256))) * 100)
    outbox = AlertOutbox(tmp_path)
    assert outbox.open() == 0
    outbox.close()


def test_a_file_cannot_steer_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "a.toml", '"\\u001b[2J\\u001b]0;owned\\u0007" = 1\n')
    assert main(["config", "check", str(path)]) == 2
    said = capsys.readouterr().err
    assert "\x1b" not in said
    assert "\\x1b[2J" in said


def test_config_check_notices_files_that_do_not_exist(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = "\n".join(f'{name} = "{tmp_path}/{name}.pem"' for name in ("ca", "certificate", "key"))
    path = written(tmp_path / "a.toml", f"[bus.tls]\n{names}\n")
    assert main(["config", "check", str(path)]) == 2
    assert "bus.tls.ca" in capsys.readouterr().err


def test_the_parsers_return_what_is_no_attack() -> None:
    assert parse_json("[[1]]") == [[1]]
    assert parse_toml("a.b.c = 1") == {"a": {"b": {"c": 1}}}
    assert parse_toml('text = "1.2.3, 4.5 and so on. Again."')


@pytest.mark.parametrize("part", ["9", '"', "a ", "a.", "a\n", ". "])
def test_the_longest_text_is_looked_through_within_a_second(part: str) -> None:
    """One word of 40 kB had taken 26 s, and the time grew with the square of its length."""
    text = part * (MAX_TOML_BYTES // len(part))
    begun_s = time.process_time()
    DEEP_KEY.search(text)
    assert time.process_time() - begun_s < 1.0
