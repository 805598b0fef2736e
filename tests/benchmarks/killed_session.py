"""Sessions that are killed at every point at which they touch the disk: what is in force afterwards, and how they go on."""

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.simulated.accelerometer import Accelerometer, typical_errors
from gateway.calibration.store import CalibrationStore
from gateway.messages import Verdict
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import VERBS, RequestAnswer
from gateway.recalibration.session import Timestamp
from tests.benchmarks.faulty_disk import FaultyDisk
from tests.values import present

RATE_HZ = 125.0
BLOCK = 25
START_NS = 1_767_225_600_000_000_000
AWAY_S = 120.0
AXES = ((0, 1), (1, 1), (2, 1))
FACES = np.vstack([sign * np.eye(3)[axis] for axis in range(3) for sign in (1, -1)])
PART = Accelerometer(typical_errors(np.random.default_rng(5), 25.0), RATE_HZ)
INFO = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=RATE_HZ, units_per_g=PART.units_per_g)
DONE = ("commit-0001", "zero-000001", "rollback-01")
"""Requests that change the record in force, in order."""


class Site:
    """A remote engineer and a rigger, who do the same however often the gateway is killed in between."""

    def __init__(self, data_dir: Path, begin_s: float, acknowledge: Callable[[str], object]) -> None:
        self.now_ns = START_NS + round(begin_s * 1e9)
        self._random = np.random.default_rng(int(begin_s))
        self._acknowledge = acknowledge
        self._data_dir = data_dir
        self.recalibration = Recalibration(data_dir, AXES, software="test", log_line=lambda _: None)
        self.recalibration.open(INFO, self.now)

    @property
    def store(self) -> CalibrationStore:
        return CalibrationStore(self._data_dir, INFO.device_id)

    @property
    def now(self) -> Timestamp:
        return Timestamp(self.now_ns, self.now_ns)

    def ask(self, verb: str, request_id: str, **content: Any) -> RequestAnswer:
        request = VERBS[verb].model_validate({"id": request_id, "by": "ann", "reason": "trial", **content})
        answer = self.recalibration.answer(verb, request, self.now).answer
        if answer.accepted:
            self._acknowledge(request_id)
        return answer

    def rest(self, up: NDArray[np.float64], seconds: float, verdict: Verdict = "unknown") -> None:
        for _ in range(round(seconds * RATE_HZ / BLOCK)):
            time_ns = self.now_ns + np.rint(np.arange(1, BLOCK + 1) * 1e9 / RATE_HZ).astype(np.int64)
            raw = PART.counts(np.tile(up, (BLOCK, 1)), np.full(BLOCK, 25.0), self._random)
            self.now_ns = int(time_ns[-1])
            self.recalibration.feed(SampleBlock(time_ns=time_ns, raw=raw), self.now)
            self.recalibration.interlock.add_verdict(verdict, self.now_ns)
            self.recalibration.tick(self.now)

    def collects(self, session_id: str) -> bool:
        session = self.recalibration.session
        return session is not None and session.id == session_id and session.phase == "collecting"

    def go(self) -> None:
        """Recalibrate and commit, zero, begin another session and cancel it, roll the zero back."""
        self.ask("recalibrate", "begin-00001", housing_off_rope=True)
        for up in FACES:
            if self.collects("begin-00001"):
                self.rest(up, 3.0)
        self.ask("commit", DONE[0])
        if DONE[1] not in [change.request for change in self.store.state().history]:
            self.rest(FACES[4], 40.0, "static")
        self.ask("zero", DONE[1])
        self.ask("recalibrate", "begin-00002", method="norm-fit", housing_off_rope=True)
        if self.collects("begin-00002"):
            self.rest(FACES[0], 3.0)
        self.ask("cancel", "cancel-0001")
        self.ask("rollback", DONE[2])


@dataclass
class Outcome:
    """State after a kill, and after its completion."""

    point: int
    power: bool
    phase: str | None
    in_force: str


def first_record(data_dir: Path) -> None:
    """Put a first record in force by a session of its own."""
    site = Site(data_dir, 0.0, lambda _: None)
    site.ask("recalibrate", "begin-00000", housing_off_rope=True)
    for up in FACES:
        site.rest(up, 3.0)
    answer = site.ask("commit", "commit-0000")
    assert answer.accepted, answer.text


def count_points(data_dir: Path) -> int:
    """Return the number of points of an undisturbed run."""
    with FaultyDisk(data_dir) as disk:
        Site(data_dir, AWAY_S, lambda _: None).go()
    check_end(data_dir)
    return disk.points


def killed_at(data_dir: Path, point: int, power: bool) -> list[str]:
    """Run in a process that ends at a point; return the requests that were answered by then."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reading)
            with FaultyDisk(data_dir, point, power):
                Site(data_dir, AWAY_S, lambda done: os.write(writing, f"{done}\n".encode())).go()
        finally:
            os._exit(1)  # it should have ended before
    os.close(writing)
    _, status = os.waitpid(child, 0)
    with os.fdopen(reading) as answered:
        done = answered.read().split()
    assert os.waitstatus_to_exitcode(status) == 9, f"point {point} was not reached"
    return done


def check_point(base: Path, folder: Path, point: int, power: bool) -> Outcome:
    """Kill at a point: a complete record is in force, no answered request is lost, and the same requests complete the rest."""
    data_dir = folder / f"{point}-{'power' if power else 'kill'}"
    shutil.copytree(base, data_dir)
    answered = killed_at(data_dir, point, power)
    store = CalibrationStore(data_dir, INFO.device_id)
    in_force = store.in_force()
    assert in_force is not None
    changes = [change.request for change in store.state().history[1:]]
    assert changes == list(DONE[: len(changes)])
    assert [request for request in answered if request in DONE] in (changes, changes[:-1])
    after = Site(data_dir, 2 * AWAY_S, lambda _: None)
    session = after.recalibration.session
    assert store.in_force() == in_force
    if session is not None and session.phase == "committed":
        assert session.record_id in (change.after for change in store.state().history)
    after.go()
    check_end(data_dir)
    shutil.rmtree(data_dir)
    return Outcome(point, power, None if session is None else session.phase, in_force.id)


def check_end(data_dir: Path) -> None:
    """Check that every request was executed once: the record of the session is in force, the zeroing was rolled back."""
    store = CalibrationStore(data_dir, INFO.device_id)
    history = store.state().history
    assert [change.request for change in history[1:]] == list(DONE), history
    assert present(store.in_force()).id == history[1].after
    assert store.record(present(history[2].after)).method == "zero"


def main(every: int = 1) -> None:
    """Test every point, or one of `every`, with a kill and with a power failure."""
    begun_s = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        base = folder / "base"
        first_record(base)
        shutil.copytree(base, folder / "whole")
        points = count_points(folder / "whole")
        outcomes = [
            check_point(base, folder, point, power) for point in range(1, points + 1, every) for power in (False, True)
        ]
    phases = {phase: sum(one.phase == phase for one in outcomes) for phase in {one.phase for one in outcomes}}
    print(f"{len(outcomes)} kills at {points} points: a whole record in force after each, every session finished")
    print(f"found after the kill: {phases}; {time.monotonic() - begun_s:.0f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
