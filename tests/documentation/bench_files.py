"""Files of the bench, as the pages on calibration have them: sessions with planted errors."""

from pathlib import Path

import cv2
import numpy as np

from devices.block import DeviceInfo
from gateway.cli.main import main
from tests.benchmarks.rendered_photographs import Scene, moved, render
from tests.documentation.reader import Reader
from tests.gateway.bench.planted.service import Weeks
from tests.gateway.bench.planted.thermal import Disturbances, draw_truth, service_at_rest, six_recordings
from tests.gateway.bench.planted.workshop import (
    FACE_NAMES,
    draw_sensor,
    faces,
    girder_end,
    laser_pairs,
    poses,
    turn,
    write_readings,
    write_table,
)
from tests.gateway.cli.test_calibrate_align import session as shaft_session
from tests.gateway.cli.test_calibrate_installed import write_weeks
from tests.recordings import write_mcap

BOARD = Scene(pitch_mm=25.0, dot_mm=12.0, spots=((3.0, -50.0),), size_px=(1000, 1000))


def calibration_sessions(reader: Reader, with_times: tuple[str, ...] = ("faces",)) -> None:
    """Six faces and fourteen poses, in counts at 100 Hz."""
    random = np.random.default_rng(1)
    sensor = draw_sensor(random)
    for name, rests in (("faces", faces(random, sensor)), ("session", poses(random, sensor))):
        counts = np.rint(256_000 * np.vstack(list(rests.values())))
        columns = {f"a{axis}_counts": counts[:, place] for place, axis in enumerate("xyz")}
        times = {"time_s": np.arange(len(counts)) / 100} if name in with_times else {}
        write_table(reader.folder / f"{name}.csv", times | columns)


def calibrated_before(reader: Reader) -> None:
    """The same with times in both, and records of the six faces in the store and in an archive."""
    calibration_sessions(reader, ("faces", "session"))
    made = ["--device-id", "adxl355-1d-0042", "--json"]
    stored, archived = reader.folder / "plumbline-data" / "calibration", reader.folder / "archive"
    for folder in (stored, archived):
        folder.mkdir(parents=True)
        faces_of = ["calibrate", "six-position", str(reader.folder / "faces.csv"), *made]
        assert main([*faces_of, str(folder / "record.json")]) == 0
    copied(stored / "record.json", reader.folder / "record.json")
    reader.texts |= {"/var/lib/plumbline": "plumbline-data"}


def turns(reader: Reader) -> None:
    """Full turns on a rig about y and x, and slow turns about x on a shaft."""
    random = np.random.default_rng(1)
    sensor = draw_sensor(random)
    for axis, name in ((1, "about_y"), (0, "about_x")):
        angle_deg, raw = turn(random, sensor, axis)
        columns = {"angle_deg": angle_deg, **{f"a{axis}_g": raw[:, n] for n, axis in enumerate("xyz")}}
        write_table(reader.folder / f"{name}.csv", columns)
    force_g = shaft_session([0.2, 0.02, 0.01, 0.01])
    write_readings(reader.folder / "turns_x.csv", force_g, time_s=np.arange(len(force_g)) / 20)


def ramps(reader: Reader) -> None:
    """A ramp on each face, and half an hour of service at rest."""
    random = np.random.default_rng(1)
    truth, added = draw_truth(random), Disturbances()
    (reader.folder / "ramps").mkdir()
    recordings = six_recordings(random, truth, "ramp", 120.0, added)
    for name, (time_s, raw, temperature_c) in zip(FACE_NAMES, recordings, strict=True):
        write_readings(reader.folder / "ramps" / f"{name}.csv", raw, time_s=time_s, temperature_c=temperature_c)
    calibration = [
        "calibrate",
        "six-position",
        *(str(path) for path in sorted((reader.folder / "ramps").glob("*.csv"))),
    ]
    assert main([*calibration, "--device-id", "part-7", "--json", str(reader.folder / "before.json")]) == 0
    _, raw, temperature_c = service_at_rest(random, truth, np.zeros(2), 1800.0, added)
    write_mcap(reader.folder / "service.mcap", _device("part-7"), raw, temperature_c=temperature_c)


def weeks(reader: Reader) -> None:
    """Swings and rests of some days on a crane, and the record by data sheet that was in force."""
    write_weeks(reader.folder / "plumbline-data", Weeks(days=12, swings_a_day=2))


def laser(reader: Reader) -> None:
    """Photographs of a spot on the board, and the pairs that they lead to."""
    for name, scene in {
        "zero": BOARD,
        "tilted-1": moved(BOARD, 3.0, 20.0),
        "tilted-2": moved(BOARD, 3.0, 45.0),
    }.items():
        cv2.imwrite(str(reader.folder / f"{name}.jpg"), render(scene), [cv2.IMWRITE_JPEG_QUALITY, 92])
    pairs = laser_pairs(np.random.default_rng(1), -0.0128, 3897.0)
    columns = {"displacement_mm": pairs[:, 0], "raw_angle_deg": pairs[:, 1]}
    write_table(reader.folder / "pairs.csv", columns)
    write_table(reader.folder / "angles.csv", {"raw_angle_deg": pairs[:, 1]})


def girder(reader: Reader) -> None:
    """Recordings of both ends of a girder."""
    random = np.random.default_rng(1)
    for name, sign in (("west", 1), ("east", -1)):
        _, raw = girder_end(random, sign, 2e-3)
        write_mcap(reader.folder / f"{name}.mcap", _device(name, 20.0), raw, sensor=name)


def _device(name: str, rate_hz: float = 50.0) -> DeviceInfo:
    return DeviceInfo("test", name, "g", odr_hz=rate_hz, units_per_g=1.0, calibrated_source=True)


def copied(path: Path, to: Path) -> None:
    """Copy a file, and make the folder for it."""
    to.parent.mkdir(parents=True, exist_ok=True)
    to.write_bytes(path.read_bytes())
