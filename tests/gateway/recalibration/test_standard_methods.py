"""Sessions with the real ways of calibrating, on a simulated part that is turned as it is asked to be."""

import json

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.simulated.accelerometer import Accelerometer, typical_errors
from gateway.calibration.poses.nominal_sensitivity import NominalSensitivity
from gateway.calibration.poses.pose import RawReadings
from gateway.calibration.procedures.procedure_factory import make_procedure
from gateway.calibration.record import CalibrationRecord
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.standard import StandardMethods
from gateway.recalibration.timestamp import Timestamp
from gateway.recalibration.view import session_message

RATE_HZ, BLOCK = 125.0, 25
START_NS = 1_767_225_600_000_000_000
AXES = ((0, 1), (1, 1), (2, 1))
PART = Accelerometer(typical_errors(np.random.default_rng(11), 25.0), RATE_HZ)
INFO = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=RATE_HZ, units_per_g=PART.units_per_g)


class Bench:
    """A part in a rigger's hands; everything that it read is kept."""

    def __init__(self, data_dir):
        self.now_ns = START_NS
        self.recalibration = Recalibration(data_dir, StandardMethods(AXES), software="test", tell=lambda _: None)
        self.recalibration.open(INFO, self.moment)
        self.blocks = []
        self._random = np.random.default_rng(2)

    @property
    def moment(self):
        return Timestamp(self.now_ns, self.now_ns)

    @property
    def session(self):
        return self.recalibration.session

    def ask(self, verb, request_id, **content):
        payload = json.dumps({"id": request_id, "by": "ann", **content}).encode()
        answer = self.recalibration.answer(verb, payload, self.moment).answer
        assert answer.accepted, answer.text

    def rest(self, up, seconds):
        for _ in range(round(seconds * RATE_HZ / BLOCK)):
            time_ns = self.now_ns + np.rint(np.arange(1, BLOCK + 1) * 1e9 / RATE_HZ).astype(np.int64)
            raw = PART.counts(np.tile(up, (BLOCK, 1)), np.full(BLOCK, 25.0), self._random)
            self.now_ns = int(time_ns[-1])
            self.blocks.append(SampleBlock(time_ns=time_ns, raw=raw))
            self.recalibration.feed(self.blocks[-1], self.moment)

    def turn_as_asked(self):
        for _ in range(40):
            if self.session.phase != "collecting":
                return
            self.rest(session_message(self.session, self.recalibration.progress).next_direction, 2.6)


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_turned_as_asked_the_planted_errors_are_found(bench, method):
    bench.ask("recalibrate", "request-1", method=method, housing_off_rope=True)
    bench.turn_as_asked()
    assert bench.session.phase == "review", bench.session.text
    assert bench.session.judgement.refused == ()
    bench.ask("commit", "request-2", reason="bench")
    record = CalibrationRecord.model_validate(bench.session.candidate)
    matrix, offset = np.array(record.correction_matrix), np.array(record.offset)
    for up in np.vstack([np.eye(3), -np.eye(3)]):
        reading = PART.units_per_g * (PART.errors.gain @ up + PART.errors.zero_g_offset_g)
        assert np.linalg.norm(matrix @ (reading - offset)) == pytest.approx(1.0, abs=1e-3)
        if method == "six-position":  # a norm fit has a frame of its own
            np.testing.assert_allclose(matrix @ (reading - offset), up, atol=1e-3)


def offline(method, blocks, parent=None):
    """The fit of the same readings in one piece."""
    procedure = make_procedure(method, NominalSensitivity(INFO.units_per_g), parent=parent)
    time_s = (np.concatenate([block.time_ns for block in blocks]) - blocks[0].time_ns[0]) * 1e-9
    procedure.feed(RawReadings(time_s, np.concatenate([block.raw for block in blocks]).astype(np.float64)))
    return procedure.finish()


def assert_same(live, fit):
    assert live["correction_matrix"] == fit.correction_matrix.tolist()
    assert live["offset"] == list(fit.offset)
    assert live["covariance"] == fit.covariance.tolist()


@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_the_offline_procedure_gives_the_same_record_for_the_same_readings(bench, method):
    bench.ask("recalibrate", "request-1", method=method, housing_off_rope=True)
    bench.turn_as_asked()
    assert_same(bench.session.candidate, offline(method, bench.blocks))


def test_a_norm_fit_keeps_the_frame_of_the_record_in_force_as_the_offline_one_does(bench):
    bench.ask("recalibrate", "request-1", method="six-position", housing_off_rope=True)
    bench.turn_as_asked()
    bench.ask("commit", "request-2", reason="bench")
    parent = CalibrationRecord.model_validate(bench.session.candidate)
    begun = len(bench.blocks)
    bench.ask("recalibrate", "request-3", method="norm-fit", housing_off_rope=True)
    bench.turn_as_asked()
    live = bench.session.candidate
    assert live["parent"] == parent.id
    assert_same(live, offline("norm-fit", bench.blocks[begun:], parent))
    hanging = PART.units_per_g * (PART.errors.gain @ [0, 0, 1] + PART.errors.zero_g_offset_g)
    assert tilt_deg(live["correction_matrix"], live["offset"], hanging) < 0.01
    bare = offline("norm-fit", bench.blocks[begun:])
    assert tilt_deg(bare.correction_matrix, bare.offset, hanging) > 0.1  # the part's own misalignment


def tilt_deg(matrix, offset, reading):
    up = np.asarray(matrix) @ (reading - np.asarray(offset))
    return np.degrees(np.arctan2(np.hypot(up[0], up[1]), up[2]))
