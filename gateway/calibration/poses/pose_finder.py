"""Finds resting poses in readings as they come; live and offline run the same."""

from dataclasses import dataclass, field

import numpy as np

from gateway.calibration.poses.faces import face_of
from gateway.calibration.poses.mean_uncertainty import correlation_factor
from gateway.calibration.poses.pose import Array, Pose, RawReadings
from gateway.calibration.poses.stillness import STILL_RATIO, StillnessGate
from gateway.calibration.poses.windows import Window, Windows


@dataclass(frozen=True, slots=True)
class NominalSensitivity:
    """What is believed of the sensor before it is calibrated."""

    units_per_g: float
    zero: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Reading at zero g; half the supply for an analogue part."""

    def in_g(self, mean: Array | tuple[float, ...]) -> Array:
        """A reading in g, to within the nominal errors, shape (3,)."""
        return np.asarray(np.subtract(mean, self.zero) / self.units_per_g)


READINGS = 300
"""Per pose (000 sec. 4)."""
TYPE_A_TARGET_G = 1e-4
"""A pose is taken with fewer readings once its mean is as good as this: 0.006 degrees."""
TYPE_A_LIMIT_G = 2e-3
"""A pose that was cut short is kept when its mean is as good as this: 0.1 degrees, as good as a face is laid."""
LEAST_S = 1.0
"""At rest before a pose is taken: several windows, for correlation to show."""
NORM_LIMIT = 0.3
"""Relative error of |m| that an uncalibrated sensor may have at rest (zero-g offset and sensitivity)."""
SHIFT_LIMIT_G = 0.002
SHIFT_SIGMA = 6.0
"""A window whose mean has moved by more than both is of another attitude."""
TURN_LIMIT_G = 0.25
"""Another pose is one that the sensor was turned for by more than about 15 degrees; offsets cancel in the difference."""
SETTLING_WINDOWS = 1
"""Left out at the start of a rest: the tail of the movement."""


@dataclass(slots=True)
class _RestInterval:
    """Windows of the rest that is being taken."""

    windows: list[Window] = field(default_factory=list)

    @property
    def duration_s(self) -> float:
        return self.windows[-1].end_s - self.windows[0].start_s if self.windows else 0.0

    @property
    def count(self) -> int:
        return sum(window.count for window in self.windows)

    def mean(self) -> Array:
        counts = np.array([window.count for window in self.windows])
        return np.asarray(counts @ np.array([window.mean for window in self.windows]) / counts.sum())

    def sigma(self) -> Array:
        """Of a reading within windows, shape (3,)."""
        freedom = self.count - len(self.windows)
        return np.asarray(np.sqrt(sum(window.square_sum for window in self.windows) / freedom))

    def type_a(self) -> Array:
        """Standard uncertainty of the mean, shape (3,), correlation reckoned with."""
        sigma = self.sigma()
        means = np.array([window.mean for window in self.windows])
        counts = np.array([window.count for window in self.windows], dtype=np.float64)
        return np.asarray(sigma / np.sqrt(self.count) * correlation_factor(means, counts, sigma))

    def pose(self, nominal: NominalSensitivity) -> Pose:
        mean, type_a, sigma = self.mean(), self.type_a(), self.sigma()
        known = [window.temperature_c for window in self.windows if window.temperature_c is not None]
        steps = [window.step for window in self.windows if window.step > 0]
        return Pose(
            mean=_triple(mean),
            type_a=_triple(type_a),
            count=self.count,
            face=face_of(nominal.in_g(mean)),
            temperature_c=float(np.mean(known)) if known else None,
            noise=_triple(sigma),
            step=min(steps, default=0.0),
        )


class PoseFinder:
    """Readings in, resting poses out. A pose ends when the sensor moves; the next one needs a turn."""

    def __init__(self, nominal: NominalSensitivity) -> None:
        self.nominal = nominal
        self.still = False
        self.text = "lay the sensor down and let it rest"
        self._windows = Windows()
        self._gate = StillnessGate(nominal.units_per_g)
        self._rest = _RestInterval()
        self._settling = SETTLING_WINDOWS
        self._last: Array | None = None
        self._turned = True
        self._lying_on = ""

    @property
    def fraction(self) -> float:
        """Of the pose that is being taken, 0 to 1; 0 where none is."""
        rest = self._rest
        if not rest.windows:
            return 0.0
        return min(rest.duration_s / LEAST_S, max(rest.count / READINGS, self._target_fraction()), 1.0)

    @property
    def seconds_left(self) -> float | None:
        """Until the pose is taken; None where none is being taken."""
        fraction, duration_s = self.fraction, self._rest.duration_s
        if fraction <= 0:
            return None
        return max(LEAST_S - duration_s, min(duration_s / fraction - duration_s, self._count_left_s()), 0.0)

    def feed(self, readings: RawReadings) -> list[Pose]:
        """Poses that these readings complete."""
        found = [self._judge(window) for window in self._windows.feed(readings)]
        return [pose for pose in found if pose is not None]

    def cut(self) -> list[Pose]:
        """The stretch of readings ends here; what follows is another pose. A pose that was nearly taken is returned."""
        pose = self._end()
        self._windows.cut()
        self._turned = True
        return [] if pose is None else [pose]

    def set_expected_pose(self, mean: tuple[float, float, float]) -> None:
        """Go on after this pose: it is the last one that was taken."""
        self._last, self._turned = np.array(mean), False
        self._lying_on = "this pose is taken; turn the sensor to the next one"

    def was_still(self, pose: Pose) -> bool:
        """Whether a pose rested, by the noise known by now: the first were judged before there was any to compare with."""
        noise_g = max(pose.noise or (0.0,)) / self.nominal.units_per_g
        return noise_g <= max(STILL_RATIO * self._gate.noise_g, pose.step / self.nominal.units_per_g)

    def _judge(self, window: Window) -> Pose | None:
        self.still = self._gate.is_still(window)
        if (
            self._last is not None
            and np.linalg.norm(window.mean - self._last) > TURN_LIMIT_G * self.nominal.units_per_g
        ):
            self._turned = True
        if window.after_gap or not self.still:
            return self._end()
        if self._settling > 0:
            self._settling -= 1
            return None
        if not self._turned:
            self.text = self._lying_on
            return None
        while self._shifted(window):  # it settles: what came before is another attitude
            self._rest.windows.pop(0)
        self._rest.windows.append(window)
        enough = self._rest.count >= READINGS or float(np.max(self._rest.type_a())) <= self._target
        self.text = "hold still"
        return self._take() if enough and self._rest.duration_s >= LEAST_S else None

    @property
    def _target(self) -> float:
        return TYPE_A_TARGET_G * self.nominal.units_per_g

    def _target_fraction(self) -> float:
        type_a = float(np.max(self._rest.type_a()))
        return min((self._target / type_a) ** 2, 1.0) if type_a > 0 else 1.0

    def _count_left_s(self) -> float:
        rest = self._rest
        return max(READINGS - rest.count, 0) * rest.duration_s / rest.count

    def _shifted(self, window: Window) -> bool:
        rest = self._rest
        if not rest.windows:
            return False
        noise = self._gate.noise_g * np.sqrt(1 / window.count + 1 / rest.count)
        limit = max(SHIFT_SIGMA * noise, SHIFT_LIMIT_G, window.step / self.nominal.units_per_g)
        return bool(np.max(np.abs(window.mean - rest.mean())) > limit * self.nominal.units_per_g)

    def _end(self) -> Pose | None:
        """The rest is over before its time: kept if it is good enough."""
        rest, self._settling = self._rest, SETTLING_WINDOWS
        if not rest.windows:
            return None
        self.text = f"moved after {rest.count} of {READINGS} readings: not taken; lay it down again"
        if rest.duration_s >= LEAST_S and float(np.max(rest.type_a())) <= TYPE_A_LIMIT_G * self.nominal.units_per_g:
            return self._take()
        self._rest = _RestInterval()
        return None

    def _take(self) -> Pose | None:
        pose, self._rest = self._rest.pose(self.nominal), _RestInterval()
        norm = float(np.linalg.norm(self.nominal.in_g(pose.mean)))
        self.set_expected_pose(pose.mean)
        if abs(norm - 1) > NORM_LIMIT:
            self.text = f"reads {norm:.2f} g at rest: not taken; is it held still, and its sensitivity right?"
            self._lying_on = self.text
            return None
        self.text = f"pose taken: {pose.count} readings"
        return pose


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
