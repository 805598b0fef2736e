"""A recalibration with a scripted way of calibrating: one pose a block, done after as many as the script says."""

import json
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.acceptance import Acceptance
from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.poses.pose import Pose
from gateway.calibration.procedures.pose_procedure import PoseProgress
from gateway.calibration.store import CalibrationStore
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.timestamp import Timestamp

START_NS = 1_767_225_600_000_000_000
DEVICE = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0)
WANTED = 2


def fit_of(method, offset):
    return CalibrationFit(
        method=method,
        offset=(offset, 0.0, 0.0),
        correction_matrix=np.eye(3) / 1000,
        covariance=np.diag([1e-12] * 9 + [1e-2] * 3),
        prediction_interval_g=0.003,
        poses=(),
        temperature_c=None,
        misalignment_deg={},
        residual_rms_g=1e-4,
        condition_number=3.0,
        budget=(),
        warnings=(),
    )


class ScriptedProcedure:
    def __init__(self, method, script):
        self.method = method
        self._script = script
        self._poses = ()

    def feed(self, readings):
        mean = tuple(readings.raw.mean(axis=0).tolist())
        self._poses = (*self._poses, Pose(mean, (0.1, 0.1, 0.1), len(readings.raw), "+z"))

    def progress(self):
        complete = len(self._poses) >= WANTED
        return PoseProgress(
            self._poses, WANTED, True, 0.5, 1.5, None if complete else "+x", None, complete, "hold still"
        )

    def resume(self, poses):
        self._poses = tuple(poses)

    def finish(self):
        if self._script.error is not None:
            raise self._script.error
        return fit_of(self.method, self._poses[0].mean[0])


@dataclass
class Script:
    """`Methods` whose outcome a test chooses."""

    judgement: Acceptance = field(default_factory=Acceptance)
    error: Exception | None = None

    def procedure(self, method, _device, _parent):
        return ScriptedProcedure(method, self)

    def zero(self, readings, _parent, _device):
        return fit_of("zero", float(readings.raw.mean()))

    def judge(self, _record, _parent):
        return self.judgement


class Site:
    """A recalibration over a data folder, with a clock that a test turns; it can be started again."""

    def __init__(self, data_dir):
        self.data_dir = data_dir
        self.script = Script()
        self.now_ns = START_NS
        self.told = []
        self.requests = 0
        self.pipeline_changed = False
        self.device = DEVICE
        self.start()

    def start(self, **changes):
        self.device = replace(self.device, **changes)
        self.recalibration = Recalibration(self.data_dir, self.script, software="test", tell=self.told.append)
        self.recalibration.open(self.device, self.moment)
        return self

    @property
    def moment(self):
        return Timestamp(self.now_ns, self.now_ns)

    @property
    def session(self):
        return self.recalibration.session

    @property
    def store(self):
        return CalibrationStore(self.data_dir, self.device.device_id)

    @property
    def in_force(self):
        return self.store.state().in_force

    def later(self, seconds):
        self.now_ns += round(seconds * 1e9)
        self.recalibration.tick(self.moment)

    def ask(self, verb, request_id=None, by="ann", **content):
        self.requests += 1
        asked = {"id": request_id or f"request-{self.requests}", "by": by, **content}
        return self.ask_raw(verb, asked)

    def ask_raw(self, verb, asked):
        response = self.recalibration.answer(verb, json.dumps(asked).encode(), self.moment)
        self.pipeline_changed = response.pipeline_changed
        return response.answer

    def begin(self, request_id=None):
        answer = self.ask("recalibrate", request_id, housing_off_rope=True)
        assert answer.accepted, answer.text
        return answer

    def pose(self, value=0.0, length=4):
        self.now_ns += 1_000_000_000
        time_ns = self.now_ns + np.arange(length) * 10_000_000
        raw = np.tile(np.array([value, 0, 1000], dtype=np.int32), (length, 1))
        self.recalibration.feed(SampleBlock(time_ns=time_ns, raw=raw), self.moment)

    def review(self, value=0.0):
        self.begin()
        for _ in range(WANTED):
            self.pose(value)
        assert self.session.phase == "review"

    def commit(self, value=0.0, **content):
        self.review(value)
        answer = self.ask("commit", **content)
        assert answer.accepted, answer.text
        return answer.content["record"]

    def hang_still(self, seconds=40):
        for _ in range(seconds * 2):
            self.now_ns += 500_000_000
            self.recalibration.watch.verdict("static", self.now_ns)
        self.recalibration.feed(
            SampleBlock(time_ns=self.now_ns + np.arange(2), raw=np.full((2, 3), 7, dtype=np.int32)), self.moment
        )

    def audit(self):
        answer = self.ask_raw("fetch", {"what": "audit", "lines": 1000})
        return answer.content["audit"]


@pytest.fixture
def site(tmp_path):
    return Site(tmp_path)
