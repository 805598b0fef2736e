"""What acts is named where the axial channel tells it, and the interval holds the angle where it does not."""

from collections.abc import Iterator

import numpy as np
import pytest

from devices.simulated.schedule import Event, Gust, Hoist, TrolleyMove
from gateway.motion.estimate import MotionEstimate
from tests.gateway.motion.conftest import Recording, follow, holds, swing

pytestmark = pytest.mark.slow

START_S = 15.0
DRIVE, GUST = TrolleyMove(START_S, 12.0, 6.0, 0.9, 0.7), Gust(START_S, 10.0, 0.09, 0.7)
HOIST = Hoist(START_S, 9.0, -1.5)
DRIVE_AND_HOIST = [HOIST, TrolleyMove(START_S + 1, 8.0, 4.0, 0.5, 2.0)]
GUST_AND_HOIST = [HOIST, Gust(START_S + 1, 8.0, 0.08, 2.0)]


def states_between(estimates: list[MotionEstimate], from_s: float, to_s: float) -> list[str]:
    return [estimate.state for estimate in estimates if from_s < estimate.time_s < to_s]


@pytest.mark.parametrize("rho", [0.1, 0.5, 0.9])
@pytest.mark.parametrize(("event", "state", "from_s", "to_s"), [(DRIVE, "driven", 2.3, 3.8), (GUST, "wind", 3.5, 6.5)])
def test_drive_and_gust_are_named_in_a_swing_that_the_axial_channel_shows(
    event: Event, state: str, from_s: float, to_s: float, rho: float
) -> None:
    recording = swing(amplitude_deg=8.0, rho=rho, events=[event], duration_s=25.0)

    named = states_between(list(follow(recording)), START_S + from_s, START_S + to_s)  # while it is strongest

    assert np.mean([one == state for one in named]) > 0.8


def test_hoist_is_named_and_measured() -> None:
    recording = swing(amplitude_deg=4.0, events=[HOIST], duration_s=30.0)

    estimates = list(follow(recording))

    in_the_middle = [e for e in estimates if START_S + 3 < e.time_s < START_S + 6]
    assert np.mean([e.state == "hoisting" for e in in_the_middle]) > 0.8
    peak_m_s = -1.875 * 1.5 / 9.0
    assert min(e.hoist_m_s or 0.0 for e in in_the_middle) == pytest.approx(peak_m_s, rel=0.15)
    assert (estimates[-1].length_m or 0.0) == pytest.approx(8.5, rel=0.02)


def test_free_swing_and_rest_are_named() -> None:
    free = states_between(list(follow(swing(amplitude_deg=5.0))), 15.0, 40.0)
    rest = states_between(list(follow(swing(amplitude_deg=0.0))), 15.0, 40.0)

    assert np.mean([one == "free" for one in free]) > 0.95
    assert np.mean([one == "rest" for one in rest]) > 0.95


def while_acting(events: list[Event], rho: float) -> Iterator[tuple[Recording, MotionEstimate]]:
    """Yield estimates until two seconds after the events, of several swings."""
    for seed in range(4):
        recording = swing(seed=seed, amplitude_deg=1.0 + 2 * seed, rho=rho, events=events, duration_s=26.0)
        yield from ((recording, estimate) for estimate in follow(recording) if estimate.time_s > START_S)


@pytest.mark.parametrize("rho", [0.3, 0.8])
@pytest.mark.parametrize("events", [DRIVE_AND_HOIST, GUST_AND_HOIST], ids=["drive", "gust"])
def test_interval_holds_the_angle_in_a_hoist_with_a_drive_or_a_gust(events: list[Event], rho: float) -> None:
    """The hoist hides the axial channel, so that drive and gust are told apart badly or not at all."""
    acting = list(while_acting(events, rho))
    held = [holds(recording, estimate) for recording, estimate in acting if estimate.angle_rad is not None]

    assert np.mean(held) > 0.9
    assert len(held) > 0.8 * len(acting)


def test_acceleration_of_the_pivot_is_measured_in_a_drive() -> None:
    recording = swing(amplitude_deg=3.0, rho=0.5, events=[DRIVE], duration_s=22.0)

    estimates = [e for e in follow(recording) if START_S + 2 < e.time_s < START_S + 4]

    sizes = [np.hypot(*(e.pivot_acceleration_m_s2 or (0.0, 0.0))) for e in estimates]
    assert np.median(sizes) == pytest.approx(1.8 * 0.9 / 6.0, rel=0.15)
