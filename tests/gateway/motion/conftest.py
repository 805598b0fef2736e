"""Recordings with a known motion, and the motion tracker that follows them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from devices.pendulum import pendulum
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.simulated.crane import HISTORY_S, Crane
from devices.simulated.schedule import Event
from gateway.motion.estimate import MotionEstimate
from gateway.motion.motion_tracker import MotionTracker
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.swing.rig import MountedHousing
from tests.values import present

GRAVITY_M_S2 = STANDARD_GRAVITY_M_S2
RATE_HZ = 50.0
BLOCK = 16


@dataclass(frozen=True)
class Recording:
    """What a sensor reads, and the rope's true angle."""

    time_s: Array
    force_g: Array
    angle_rad: Array
    rig: MountedHousing

    def without(self, from_s: float, to_s: float) -> "Recording":
        """Return the recording with a gap."""
        kept = (self.time_s < from_s) | (self.time_s >= to_s)
        return Recording(self.time_s[kept], self.force_g[kept], self.angle_rad[kept], self.rig)

    def angle_at(self, time_s: float) -> float:
        return float(np.interp(time_s, self.time_s, self.angle_rad))


def swing(
    *,
    seed: int = 1,
    duration_s: float = 40.0,
    amplitude_deg: float = 4.0,
    length_m: float = 10.0,
    rho: float = 0.5,
    events: Iterable[Event] = (),
    noise_g: float = 4e-4,
    offset_g: float = 3e-4,
    damping_ratio: float = 0.003,
) -> Recording:
    """A swing at a random azimuth on a rope that is believed 5 % wrong (1 sigma), with events of the simulated crane."""
    rng = np.random.default_rng(seed)
    start, speed = amplitude_deg * np.exp(1j * rng.uniform(0, 2 * np.pi)), np.sqrt(GRAVITY_M_S2 / length_m)
    side = 0.2 * speed * start * 1j
    motion = pendulum.start_motion(*np.radians([start.real, start.imag, side.real, side.imag]))
    crane = Crane(
        length_m=length_m,
        position_m=rho * length_m,
        events=tuple(events),
        motion=motion,
        damping_ratio=damping_ratio,
    )
    time_s: Array = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    force_g, angle_rad = sense(crane, time_s)
    force_g += noise_g * rng.normal(size=force_g.shape) + offset_g * rng.normal(size=3)
    return Recording(time_s, force_g, angle_rad, believed(rng, length_m, rho))


def sense(crane: Crane, time_s: Array) -> tuple[Array, Array]:
    """Return the specific force in g at the housing and the rope's true angle, while the crane still remembers both."""
    parts = np.array_split(time_s, 1 + int((time_s[-1] - time_s[0]) / HISTORY_S))
    sensed = [(crane.specific_force_m_s2(part), crane.truth(part).rope_angle_rad) for part in parts]
    force_m_s2, angle_rad = (np.concatenate(each) for each in zip(*sensed, strict=True))
    return force_m_s2 / GRAVITY_M_S2, angle_rad


def believed(rng: np.random.Generator, length_m: float, rho: float) -> MountedHousing:
    return MountedHousing(
        length_m=length_m * (1 + 0.05 * rng.normal()),
        above_load_m=(1 - rho) * length_m,
        length_u_rel=0.05,
        position_u_m=0.02,
        zero_g_offset_u_g=(3e-4, 3e-4, 3e-4),
    )


def new_tracker(rig: MountedHousing) -> MotionTracker:
    return MotionTracker(rig, mount_u_rad=1e-3)


def follow(recording: Recording, tracker: MotionTracker | None = None, block: int = BLOCK) -> Iterator[MotionEstimate]:
    """Yield an estimate for each bin, at the end of the block that completed it."""
    tracker = tracker or new_tracker(recording.rig)
    for begin in range(0, len(recording.time_s), block):
        time_s, force_g = recording.time_s[begin : begin + block], recording.force_g[begin : begin + block]
        if tracker.update(time_s, force_g):
            yield tracker.estimate(float(time_s[-1]))


def normalised_errors(recording: Recording, estimates: Iterable[MotionEstimate]) -> Array:
    """Errors of the angle over their standard uncertainties."""
    return np.array([(present(e.angle_rad) - recording.angle_at(e.time_s)) / present(e.u_rad) for e in estimates])


def holds(recording: Recording, estimate: MotionEstimate) -> bool:
    """Whether the 95 % interval holds the true angle."""
    return bool(abs(normalised_errors(recording, [estimate])[0]) < NORMAL_975)


@pytest.fixture(scope="session")
def free_swing() -> Recording:
    return swing()
