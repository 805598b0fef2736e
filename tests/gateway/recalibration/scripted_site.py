"""A recalibration with a scripted procedure: each block is a pose, and the test chooses the outcome of the fit."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.acceptance import Acceptance
from gateway.calibration.calibration_fit import CalibrationFit
from gateway.calibration.pose import Pose, RawReadings
from gateway.calibration.pose_procedure import PoseProgress
from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import CalibrationStore
from gateway.messages import SessionPhase
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import VERBS, Fetch, RequestAnswer, parse_payload
from gateway.recalibration.session import Session, Timestamp, make_session_message

START_NS = 1_767_225_600_000_000_000
DEVICE = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0)
AXES = ((0, 1), (1, 1), (2, 1))
N_POSES = 2


def make_fit(method: str, offset: float) -> CalibrationFit:
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


class Script:
    """Outcome of the fits, chosen by a test."""

    def __init__(self) -> None:
        self.acceptance = Acceptance()
        self.error: Exception | None = None

    def make_procedure(self, method: str, *_arguments: object, **_options: object) -> "ScriptedProcedure":
        return ScriptedProcedure(method, self)

    def zero_in_place(self, readings: RawReadings, *_arguments: object) -> CalibrationFit:
        return make_fit("zero", float(readings.raw.mean()))

    def judge(self, *_arguments: object) -> Acceptance:
        return self.acceptance


class ScriptedProcedure:
    """Takes every block as a pose, and is complete after `N_POSES` of them."""

    def __init__(self, method: str, script: Script) -> None:
        self._method = method
        self._script = script
        self._poses: tuple[Pose, ...] = ()

    def feed(self, readings: RawReadings) -> None:
        x, y, z = readings.raw.mean(axis=0).tolist()
        self._poses = (*self._poses, Pose((x, y, z), (0.1, 0.1, 0.1), len(readings.raw), "+z"))

    def progress(self) -> PoseProgress:
        complete = len(self._poses) >= N_POSES
        return PoseProgress(
            poses=self._poses,
            wanted=N_POSES,
            still=True,
            pose_fraction=0.5,
            seconds_left=1.5,
            next_face=None if complete else "+x",
            next_direction=None,
            complete=complete,
            text="hold still",
            hints=("pose_hold",),
        )

    def resume(self, poses: tuple[Pose, ...]) -> None:
        self._poses = tuple(poses)

    def finish(self) -> CalibrationFit:
        if self._script.error is not None:
            raise self._script.error
        return make_fit(self._method, self._poses[0].mean[0])


class Site:
    """A recalibration with a data folder and a clock that a test sets; it can be restarted."""

    def __init__(self, data_dir: Path, script: Script) -> None:
        self.data_dir = data_dir
        self.script = script
        self.now_ns = START_NS
        self.log_lines: list[str] = []
        self.requests = 0
        self.pipeline_changed = False
        self.device = DEVICE
        self.restart()

    def restart(self, **changes: Any) -> "Site":
        """Start again on the same folder, with a changed device if fields of it are given."""
        self.device = replace(self.device, **changes)
        self.recalibration = Recalibration(self.data_dir, AXES, software="test", log_line=self.log_lines.append)
        self.recalibration.open(self.device, self.now)
        return self

    @property
    def now(self) -> Timestamp:
        return Timestamp(self.now_ns, self.now_ns)

    @property
    def session(self) -> Session:
        assert self.recalibration.session is not None
        return self.recalibration.session

    def phase(self) -> SessionPhase:
        """Return the phase of the session; a method, because the type checker takes a property to be constant."""
        return self.session.phase

    @property
    def suspension(self) -> str:
        """The reason of the suspension, empty if there is none."""
        return make_session_message(self.recalibration.session, None).suspension or ""

    @property
    def store(self) -> CalibrationStore:
        return CalibrationStore(self.data_dir, self.device.device_id)

    def in_force(self) -> str | None:
        """Return the id of the record in force."""
        return self.store.state().in_force

    def record_in_force(self) -> CalibrationRecord:
        record = self.store.in_force()
        assert record is not None
        return record

    def wait(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)
        self.recalibration.tick(self.now)

    def ask(self, verb: str, request_id: str | None = None, by: str = "ann", **content: Any) -> RequestAnswer:
        self.requests += 1
        return self.ask_raw(verb, {"id": request_id or f"request-{self.requests}", "by": by, **content})

    def ask_raw(self, verb: str, content: dict[str, Any]) -> RequestAnswer:
        payload = json.dumps(content).encode()
        if verb == "fetch":
            return self.recalibration.fetch(parse_payload(Fetch, payload))
        response = self.recalibration.answer(verb, parse_payload(VERBS[verb], payload), self.now)
        self.pipeline_changed = response.pipeline_changed
        return response.answer

    def start_session(self, request_id: str | None = None) -> RequestAnswer:
        answer = self.ask("recalibrate", request_id, housing_off_rope=True)
        assert answer.accepted, answer.text
        return answer

    def take_pose(self, value: float = 0.0, length: int = 4) -> None:
        self.now_ns += 1_000_000_000
        time_ns = self.now_ns + np.arange(length) * 10_000_000
        raw = np.tile(np.array([value, 0, 1000], dtype=np.int32), (length, 1))
        self.recalibration.feed(SampleBlock(time_ns=time_ns, raw=raw), self.now)

    def review(self, value: float = 0.0) -> None:
        """Run a session up to the review; the record has this offset."""
        self.start_session()
        for _ in range(N_POSES):
            self.take_pose(value)
        assert self.phase() == "review"

    def commit(self, value: float = 0.0, **content: Any) -> str:
        """Run a session up to the commit; return the id of the record."""
        self.review(value)
        answer = self.ask("commit", **content)
        assert answer.accepted, answer.text
        record_id: str = answer.content["record"]
        return record_id

    def hang_still(self, seconds: int = 40) -> None:
        for _ in range(seconds * 2):
            self.now_ns += 500_000_000
            self.recalibration.interlock.add_verdict("static", self.now_ns)
        self.recalibration.feed(
            SampleBlock(time_ns=self.now_ns + np.arange(2), raw=np.full((2, 3), 7, dtype=np.int32)), self.now
        )

    def audit(self) -> list[dict[str, Any]]:
        answer = self.ask_raw("fetch", {"what": "audit", "lines": 1000})
        entries: list[dict[str, Any]] = answer.content["audit"]
        return entries
