"""The pose finder: it detects resting poses in a stream of readings, the same for live and for offline calibration."""

import numpy as np

from gateway.calibration.pose import NominalSensitivity, Pose, RawReadings, find_face, temperature_range
from gateway.calibration.windows import STILL_RATIO, Rest, StillnessGate, Window, WindowSplitter
from gateway.messages.header import Reason
from gateway.numerics.array import Array

READINGS_PER_POSE = 300
"""Number of readings of a pose (Łuczak et al. 2022, sec. 4)."""
TARGET_TYPE_A_G = 1e-4
"""Uncertainty of the mean, g, at which fewer readings complete a pose. Basis: 0.006 degrees of tilt."""
MAX_TYPE_A_G = 2e-3
"""Largest uncertainty of the mean, g, of a rest that ended early. Basis: 0.1 degrees, the uncertainty of the placement of a
face."""
MIN_POSE_REST_S = 1.0
"""Shortest rest of a pose, s. Basis: four windows, so that correlation of the noise can show."""
NORM_TOLERANCE = 0.3
"""Largest relative error of the magnitude at rest of an uncalibrated sensor, from zero-g offset and sensitivity together. Basis:
a choice; the offsets of data sheets reach 0.25 g, and a sensor in a hand that moves differs by more."""
SHIFT_LIMIT_G = 0.002
"""Least change of the mean, g, that can be another attitude. Basis: 0.1 degrees, the uncertainty of the placement of a face."""
K_SHIFT = 6.0
"""Standard deviations of the noise that a change of the mean must exceed as well, to be another attitude. Basis: a choice; chance
does not reach it, and another face differs by far more."""
MIN_TURN_G = 0.087
"""Least difference between two readings of two poses, g; zero-g offsets cancel in it. Basis: 5 degrees, `MAX_FACE_ANGLE_DEG`: a
sensor that was tilted so far against a face and is then laid down on it has taken another pose."""
SETTLING_WINDOWS = 1
"""Number of windows that are discarded at the start of a rest. Basis: the movement ends within the first one."""
PLACE_SENSOR = Reason("pose_place", "lay the sensor down and let it rest")
TURN_SENSOR = Reason("pose_turn", "this pose is taken; turn the sensor to the next one")
HOLD_SENSOR = Reason("pose_hold", "hold still")


class PoseFinder:
    """Finds resting poses. A pose ends when the sensor moves; the next one requires a turn."""

    def __init__(self, nominal: NominalSensitivity) -> None:
        self.nominal = nominal
        self.still = False
        """Whether the newest window is still."""
        self.text = PLACE_SENSOR
        """State of the pose for the rigger."""
        self.rests = 0
        """Number of rests that lasted long enough for a pose, whether or not one was taken."""
        self._still_s = 0.0
        self._splitter = WindowSplitter()
        self._gate = StillnessGate(nominal.units_per_g)
        self._rest = Rest()
        self._settling_windows = SETTLING_WINDOWS
        self._last_mean: Array | None = None
        self._turned = True
        self._unturned_text = TURN_SENSOR

    @property
    def fraction(self) -> float:
        """Completed fraction of the pose that is being taken, 0 to 1; 0 if none is being taken."""
        rest = self._rest
        if not rest.windows:
            return 0.0
        return min(rest.duration_s / MIN_POSE_REST_S, max(rest.count / READINGS_PER_POSE, self._target_fraction()), 1.0)

    @property
    def seconds_left(self) -> float | None:
        """Expected time until the pose is complete, s; None if none is being taken."""
        fraction, duration_s = self.fraction, self._rest.duration_s
        if fraction <= 0:
            return None
        return max(MIN_POSE_REST_S - duration_s, min(duration_s / fraction - duration_s, self._count_left_s()), 0.0)

    def feed(self, readings: RawReadings) -> list[Pose]:
        """Return the poses that these readings complete."""
        poses = [self._process_window(window) for window in self._splitter.feed(readings)]
        return [pose for pose in poses if pose is not None]

    def end_segment(self) -> list[Pose]:
        """End the pose at the end of a segment of readings, and return it if its mean is good enough."""
        pose = self._end_rest()
        self._splitter.start_new_segment()
        self._still_s = 0.0
        self._turned = True
        return [] if pose is None else [pose]

    def set_last_pose(self, mean: tuple[float, float, float]) -> None:
        """Continue after this pose: the next one requires a turn from it."""
        self._last_mean, self._turned = np.array(mean), False
        self._unturned_text = TURN_SENSOR

    def was_still(self, pose: Pose) -> bool:
        """Return whether a pose was still by the noise that is known now: the first poses had little noise to compare with."""
        noise_g = max(pose.noise or (0.0,)) / self.nominal.units_per_g
        return noise_g <= max(STILL_RATIO * self._gate.noise_g, pose.step / self.nominal.units_per_g)

    def _process_window(self, window: Window) -> Pose | None:
        self.still = self._gate.is_still(window)
        if (
            self._last_mean is not None
            and np.linalg.norm(window.mean - self._last_mean) > MIN_TURN_G * self.nominal.units_per_g
        ):
            self._turned = True
        self._count_rest(window)
        if window.after_gap or not self.still:
            return self._end_rest()
        if self._settling_windows > 0:
            self._settling_windows -= 1
            return None
        if not self._turned:
            self.text = self._unturned_text
            return None
        while self._is_shifted(window):  # the sensor is settling: the oldest windows are of another attitude
            self._rest.windows.pop(0)
        self._rest.windows.append(window)
        is_enough = self._rest.count >= READINGS_PER_POSE or float(np.max(self._rest.type_a())) <= self._target
        self.text = HOLD_SENSOR
        return self._complete_pose() if is_enough and self._rest.duration_s >= MIN_POSE_REST_S else None

    def _count_rest(self, window: Window) -> None:
        before_s = self._still_s if self.still and not window.after_gap else 0.0
        self._still_s = before_s + (window.end_s - window.start_s if self.still else 0.0)
        self.rests += before_s < MIN_POSE_REST_S <= self._still_s

    @property
    def _target(self) -> float:
        return TARGET_TYPE_A_G * self.nominal.units_per_g

    def _target_fraction(self) -> float:
        type_a = float(np.max(self._rest.type_a()))
        return min((self._target / type_a) ** 2, 1.0) if type_a > 0 else 1.0

    def _count_left_s(self) -> float:
        rest = self._rest
        return max(READINGS_PER_POSE - rest.count, 0) * rest.duration_s / rest.count

    def _is_shifted(self, window: Window) -> bool:
        rest = self._rest
        if not rest.windows:
            return False
        noise_g = self._gate.noise_g * np.sqrt(1 / window.count + 1 / rest.count)
        limit_g = max(K_SHIFT * noise_g, SHIFT_LIMIT_G, window.step / self.nominal.units_per_g)
        return bool(np.max(np.abs(window.mean - rest.mean())) > limit_g * self.nominal.units_per_g)

    def _end_rest(self) -> Pose | None:
        """End a rest before its pose is complete; return the pose if its mean is good enough."""
        rest, self._settling_windows = self._rest, SETTLING_WINDOWS
        if not rest.windows:
            return None
        self.text = Reason(
            "pose_moved", f"moved after {rest.count} of {READINGS_PER_POSE} readings: not taken; lay it down again"
        )
        if (
            rest.duration_s >= MIN_POSE_REST_S
            and float(np.max(rest.type_a())) <= MAX_TYPE_A_G * self.nominal.units_per_g
        ):
            return self._complete_pose()
        self._rest = Rest()
        return None

    def _complete_pose(self) -> Pose | None:
        pose, self._rest = self._pose_of(self._rest), Rest()
        norm_g = float(np.linalg.norm(self.nominal.in_g(pose.mean)))
        self.set_last_pose(pose.mean)
        if abs(norm_g - 1) > NORM_TOLERANCE:
            self.text = Reason(
                "pose_implausible",
                f"reads {norm_g:.2f} g at rest: not taken; hold the sensor still and check its sensitivity",
            )
            self._unturned_text = self.text
            return None
        self.text = Reason("pose_taken", f"pose taken: {pose.count} readings")
        return pose

    def _pose_of(self, rest: Rest) -> Pose:
        mean, steps = rest.mean(), [window.step for window in rest.windows if window.step > 0]
        temperature_c = temperature_range(window.temperature_c for window in rest.windows)
        return Pose(
            mean=_triple(mean),
            type_a=_triple(rest.type_a()),
            count=rest.count,
            face=find_face(self.nominal.in_g(mean)),
            temperature_c=None if temperature_c is None else temperature_c["mean"],
            noise=_triple(rest.sigma()),
            step=min(steps, default=0.0),
        )


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
