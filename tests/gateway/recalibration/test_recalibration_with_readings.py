"""Sessions with the real methods, on a simulated sensor that is turned as requested."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from devices.block import DeviceInfo, SampleBlock
from devices.simulated.accelerometer import Accelerometer, typical_errors
from gateway.calibration.calibration_fit import CalibrationFit
from gateway.calibration.pose import NominalSensitivity, RawReadings
from gateway.calibration.pose_procedure import make_procedure
from gateway.calibration.record import CalibrationRecord
from gateway.numerics.array import Array
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import VERBS
from gateway.recalibration.session import Session, Timestamp, make_session_message

pytestmark = pytest.mark.slow

RATE_HZ, BLOCK = 125.0, 25
START_NS = 1_767_225_600_000_000_000
AXES = ((0, 1), (1, 1), (2, 1))
PART = Accelerometer(typical_errors(np.random.default_rng(11), 25.0), RATE_HZ)
INFO = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=RATE_HZ, units_per_g=PART.units_per_g)


class Bench:
    """A sensor in the hands of a rigger; its readings are kept."""

    def __init__(self, data_dir: Path) -> None:
        self.now_ns = START_NS
        self.recalibration = Recalibration(data_dir, AXES, software="test", log_line=lambda _: None)
        self.recalibration.open(INFO, self.now)
        self.blocks: list[SampleBlock] = []
        self._random = np.random.default_rng(2)

    @property
    def now(self) -> Timestamp:
        return Timestamp(self.now_ns, self.now_ns)

    @property
    def session(self) -> Session:
        assert self.recalibration.session is not None
        return self.recalibration.session

    @property
    def candidate(self) -> dict[str, Any]:
        assert self.session.candidate is not None
        return self.session.candidate

    def ask(self, verb: str, request_id: str, **content: Any) -> None:
        request = VERBS[verb].model_validate({"id": request_id, "by": "ann", **content})
        answer = self.recalibration.answer(verb, request, self.now).answer
        assert answer.accepted, answer.text

    def rest(self, up: ArrayLike, seconds: float) -> None:
        for _ in range(round(seconds * RATE_HZ / BLOCK)):
            time_ns = self.now_ns + np.rint(np.arange(1, BLOCK + 1) * 1e9 / RATE_HZ).astype(np.int64)
            raw = PART.counts(np.tile(up, (BLOCK, 1)), np.full(BLOCK, 25.0), self._random)
            self.now_ns = int(time_ns[-1])
            self.blocks.append(SampleBlock(time_ns=time_ns, raw=raw))
            self.recalibration.feed(self.blocks[-1], self.now)

    def turn_as_requested(self) -> None:
        for _ in range(40):
            if self.session.phase != "collecting":
                return
            direction = make_session_message(self.session, self.recalibration.progress).next_direction
            assert direction is not None
            self.rest(direction, 2.6)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_the_injected_errors_are_found(bench: Bench, method: str) -> None:
    bench.ask("recalibrate", "request-1", method=method, housing_off_rope=True)
    bench.turn_as_requested()
    assert bench.session.phase == "review", bench.session.text
    assert bench.session.judgement is not None
    assert bench.session.judgement.refused == ()
    bench.ask("commit", "request-2", reason="bench")
    record = CalibrationRecord.model_validate(bench.candidate)
    matrix, offset = np.array(record.correction_matrix), np.array(record.offset)
    for up in np.vstack([np.eye(3), -np.eye(3)]):
        reading = PART.units_per_g * (PART.errors.gain @ up + PART.errors.zero_g_offset_g)
        assert np.linalg.norm(matrix @ (reading - offset)) == pytest.approx(1.0, abs=1e-3)
        if method == "six-position":  # the frame of a norm fit is symmetric
            np.testing.assert_allclose(matrix @ (reading - offset), up, atol=1e-3)


def fit_offline(method: str, blocks: list[SampleBlock], parent: CalibrationRecord | None = None) -> CalibrationFit:
    """Return the fit of the same readings, fed at once."""
    procedure = make_procedure(method, NominalSensitivity(INFO.units_per_g), parent=parent)
    time_s = (np.concatenate([block.time_ns for block in blocks]) - blocks[0].time_ns[0]) * 1e-9
    procedure.feed(RawReadings(time_s, np.concatenate([block.raw for block in blocks]).astype(np.float64)))
    return procedure.finish()


def assert_same(live: dict[str, Any], fit: CalibrationFit) -> None:
    assert live["correction_matrix"] == fit.correction_matrix.tolist()
    assert live["offset"] == list(fit.offset)
    assert live["covariance"] == fit.covariance.tolist()


@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_the_offline_procedure_makes_the_same_record_from_the_same_readings(bench: Bench, method: str) -> None:
    bench.ask("recalibrate", "request-1", method=method, housing_off_rope=True)
    bench.turn_as_requested()
    assert_same(bench.candidate, fit_offline(method, bench.blocks))


def test_a_norm_fit_keeps_the_frame_of_the_record_in_force_live_and_offline(bench: Bench) -> None:
    bench.ask("recalibrate", "request-1", method="six-position", housing_off_rope=True)
    bench.turn_as_requested()
    bench.ask("commit", "request-2", reason="bench")
    parent = CalibrationRecord.model_validate(bench.candidate)
    begun = len(bench.blocks)
    bench.ask("recalibrate", "request-3", method="norm-fit", housing_off_rope=True)
    bench.turn_as_requested()
    live = bench.candidate
    assert live["parent"] == parent.id
    assert_same(live, fit_offline("norm-fit", bench.blocks[begun:], parent))
    hanging = PART.units_per_g * (PART.errors.gain @ [0, 0, 1] + PART.errors.zero_g_offset_g)
    assert tilt_deg(live["correction_matrix"], live["offset"], hanging) < 0.01
    bare = fit_offline("norm-fit", bench.blocks[begun:])
    assert tilt_deg(bare.correction_matrix, bare.offset, hanging) > 0.1  # the misalignment of the sensor


def tilt_deg(matrix: ArrayLike, offset: ArrayLike, reading: Array) -> float:
    up = np.asarray(matrix) @ (reading - np.asarray(offset))
    return float(np.degrees(np.arctan2(np.hypot(up[0], up[1]), up[2])))
