"""What makes the motion unknown or less certain: faults of the sensor, clipping, temperature, a housing that is elsewhere."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from devices.simulated.schedule import Hoist
from gateway.messages.header import Reason
from gateway.motion.description import engineer_reasons
from gateway.motion.estimate import MotionEstimate
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing
from tests.gateway.motion.conftest import Recording, swing
from tests.values import present

pytestmark = pytest.mark.slow

NOISE_G = 4e-4
UPDATE = 5
"""Samples between two estimates: a tenth of a second."""


def monitor_of(rig: MountedHousing) -> MotionMonitor:
    return MotionMonitor(rig, mount_u_rad=1e-3, noise_g=NOISE_G)


def follow(
    recording: Recording, monitor: MotionMonitor | None = None, clipped: Callable[[float], bool] = lambda _: False
) -> Iterator[MotionEstimate]:
    """Yield the estimate of every tenth of a second."""
    monitor = monitor or monitor_of(recording.rig)
    for begin in range(0, len(recording.time_s), UPDATE):
        time_s = recording.time_s[begin : begin + UPDATE]
        is_clipped = np.full(len(time_s), clipped(float(time_s[-1])))
        monitor.update(time_s, recording.force_g[begin : begin + UPDATE], is_clipped)
        yield monitor.estimate(float(time_s[-1]))


def spoilt(recording: Recording, spoil: Callable[[Array], Array], from_s: float = 0.0) -> Recording:
    """Return the recording with readings that are wrong from a time on."""
    later = recording.time_s >= from_s
    force_g = recording.force_g.copy()
    force_g[later] = spoil(force_g[later])
    return replace(recording, force_g=force_g)


def dead(axis: int, level_g: float, noise_g: float = 0.0) -> Callable[[Array], Array]:
    def spoil(force_g: Array) -> Array:
        found = force_g.copy()
        found[:, axis] = level_g + noise_g * np.random.default_rng(9).normal(size=len(found))
        return found

    return spoil


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (dead(1, 0.0), "y does not change at all"),
        (lambda force_g: 1.25 * force_g, "wrong unit or scale"),
        (lambda force_g: force_g * 9.80665, "wrong unit or scale"),
        (lambda force_g: force_g * [1, -1, -1], "not upright"),
        (lambda force_g: force_g[:, [2, 0, 1]], "not upright"),
    ],
)
@pytest.mark.parametrize("from_s", [0.0, 12.0])
def test_a_fault_of_the_sensor_makes_the_angle_unknown(
    spoil: Callable[[Array], Array], reason: str, from_s: float
) -> None:
    recording = spoilt(swing(duration_s=25.0), spoil, from_s)

    later = [e for e in follow(recording) if e.time_s > from_s + 7.0]

    assert all(e.angle_rad is None and e.state == "unknown" for e in later)
    assert all(reason in e.reasons[0] for e in later)


def test_the_angle_is_known_again_after_a_fault() -> None:
    recording = swing(duration_s=45.0)
    faulty = (recording.time_s > 10.0) & (recording.time_s < 20.0)
    force_g = recording.force_g.copy()
    force_g[faulty, 0] = 0.0

    estimates = list(follow(replace(recording, force_g=force_g)))

    assert all(e.angle_rad is None for e in estimates if 14.0 < e.time_s < 20.0)
    assert all(e.angle_rad is not None for e in estimates if e.time_s > 28.0)
    last = estimates[-1]
    assert present(last.angle_rad) == pytest.approx(recording.angle_at(last.time_s), abs=4 * present(last.u_rad))


@pytest.mark.parametrize(("axis", "level_g"), [(0, 0.01), (1, 0.0), (2, 0.998)])
@pytest.mark.parametrize("rho", [0.1, 0.5])
def test_a_noisy_dead_axis_is_reported(axis: int, level_g: float, rho: float) -> None:
    recording = swing(seed=5, amplitude_deg=6.0, rho=rho, duration_s=30.0)

    later = [e for e in follow(spoilt(recording, dead(axis, level_g, NOISE_G))) if e.time_s > 18.0]

    assert len(later) > 100
    assert all(e.angle_rad is None for e in later)
    assert all("xyz"[axis] in e.reasons[0].split(" shows")[0] for e in later)


def known_share(recording: Recording) -> float:
    return float(np.mean([e.angle_rad is not None for e in follow(recording) if e.time_s > recording.rig.length_m / 2]))


def test_a_rope_that_rings_after_a_drive_is_no_dead_axis() -> None:
    recording = swing(seed=5, amplitude_deg=1.0, rho=0.4, duration_s=45.0)
    since_s = np.maximum(recording.time_s - 12.0, 0.0)
    ringing_g = 0.05 * np.exp(-since_s / 60) * np.sin(2 * np.pi * 2.5 * since_s)
    bounce_g = 0.5e-3 * np.sin(2 * np.pi * 0.36 * since_s)

    rings = spoilt(recording, lambda force_g: force_g + np.column_stack([ringing_g, ringing_g, bounce_g]))

    assert known_share(rings) > 0.99


def test_a_swing_along_one_axis_on_converging_ropes_is_no_dead_axis() -> None:
    recording = swing(seed=5, amplitude_deg=4.0, rho=0.9, duration_s=40.0)
    converging = replace(recording.rig, position_m=None, above_load_m=0.1 * recording.rig.length_m)
    less_across = spoilt(
        recording, lambda force_g: force_g * [0.58, 0.0, 1.0] + 1e-3 * force_g[:, [1, 0, 2]] * [0, 1, 0]
    )

    assert known_share(replace(less_across, rig=converging)) > 0.99


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_a_housing_that_is_elsewhere_widens_the_interval(share: float) -> None:
    recording = swing(seed=2, amplitude_deg=7.0, rho=0.4, duration_s=45.0)
    wrong = MountedHousing(length_m=10.0, position_m=share * 4.0, position_u_m=0.05)

    later = [e for e in follow(replace(recording, rig=wrong)) if e.time_s > 20.0]

    assert all("the housing is not where stated" in e.reasons[-1] for e in later)
    off = [abs(present(e.angle_rad) - recording.angle_at(e.time_s)) / present(e.u_rad) for e in later]
    assert np.mean(np.array(off) < 2) > 0.95


@pytest.mark.parametrize(("askew_deg", "says"), [(7.0, True), (0.5, False)])
def test_a_housing_that_stands_askew_is_named_with_its_angle(askew_deg: float, says: bool) -> None:
    recording = swing(seed=5, amplitude_deg=3.0, rho=0.6, duration_s=45.0)
    cosine, sine = np.cos(np.radians(askew_deg)), np.sin(np.radians(askew_deg))
    turned = replace(
        recording, force_g=recording.force_g @ np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
    )
    monitor = MotionMonitor(recording.rig, mount_u_rad=float(np.radians(5.0)), noise_g=NOISE_G)

    estimate = list(follow(turned, monitor))[-1]

    assert np.degrees(present(estimate.mount_rad)) == pytest.approx(askew_deg, abs=0.5)
    assert any("askew on the rope" in reason for reason in engineer_reasons(estimate)) is says


def test_clipping_is_bridged_for_a_second_and_then_makes_the_angle_unknown() -> None:
    recording = swing(duration_s=20.0)

    estimates = list(follow(recording, clipped=lambda time_s: 10.0 < time_s < 13.0))

    assert all(e.angle_rad is not None for e in estimates if 8.0 < e.time_s < 10.9)
    unknown = [e for e in estimates if 11.2 < e.time_s < 12.9]
    assert all(e.angle_rad is None and "clipped for" in e.reasons[0] for e in unknown)
    assert all(e.angle_rad is not None for e in estimates if e.time_s > 13.3)


def test_the_first_angle_comes_within_one_period() -> None:
    recording = swing(duration_s=8.0)

    known = [e.time_s for e in follow(recording) if e.angle_rad is not None]

    assert 0.4 * recording.rig.small_swing_period_s < known[0] < recording.rig.small_swing_period_s


def test_restart_forgets_the_motion() -> None:
    recording = swing(duration_s=20.0)
    monitor = monitor_of(recording.rig)
    list(follow(recording, monitor))
    monitor.restart()

    again = list(follow(recording, monitor))

    assert repr(again) == repr(list(follow(recording)))


def test_a_hoist_is_followed_and_reported() -> None:
    begin_s, end_s = 15.0, 27.0
    recording = swing(amplitude_deg=7.0, rho=0.5, duration_s=50.0, events=[Hoist(begin_s, end_s - begin_s, -3.0)])

    estimates = list(follow(recording))

    within = [e for e in estimates if begin_s + 4 < e.time_s < end_s - 1]
    assert np.mean([e.state == "hoisting" for e in within]) > 0.6
    assert all(present(e.hoist_m_s) < 0 for e in within if e.state == "hoisting")
    late = [e for e in estimates if e.time_s > 10.0]
    assert all(e.angle_rad is not None for e in late)
    off = [abs(present(e.angle_rad) - recording.angle_at(e.time_s)) / present(e.u_rad) for e in late]
    assert np.mean(np.array(off) < 2) > 0.9
    assert estimates[-1].length_m == pytest.approx(7.0, rel=0.01)
    assert estimates[-1].state == "free"


def test_a_changed_sensor_widens_the_interval_and_says_why() -> None:
    recording = swing(duration_s=30.0)
    monitor, undisturbed = monitor_of(recording.rig), monitor_of(recording.rig)
    warm = replace(recording.rig, zero_g_offset_u_g=(3e-3,) * 3, scale_u=(0.02,) * 3)
    first = replace(recording, time_s=recording.time_s[:1000], force_g=recording.force_g[:1000])
    list(follow(first, monitor))
    before = list(follow(first, undisturbed))[-1]
    monitor.set_sensor(warm, np.full(3, 3e-3), (Reason("temperature", "widened: warm"),))

    after = monitor.estimate(float(first.time_s[-1]))

    assert after.reasons == (Reason("temperature", "widened: warm"),)
    assert present(after.u_rad) > present(before.u_rad)


def test_readings_that_nothing_explains_are_reported() -> None:
    recording = swing(duration_s=20.0)
    force_g = recording.force_g.copy()
    force_g[750:780] += (0.6, -0.5, 0.4)  # a blow of two samples would be noise of its bin
    monitor = monitor_of(recording.rig)

    seen = [(e.time_s, monitor.is_explained) for e in follow(replace(recording, force_g=force_g), monitor)]

    assert all(explained for time_s, explained in seen if time_s < 15.0 or time_s > 18.2)
    assert not any(explained for time_s, explained in seen if 16.2 < time_s < 16.8)


@pytest.mark.parametrize("block", [1, 5, 10])
def test_estimates_do_not_depend_on_the_blocks(block: int) -> None:
    recording = swing(duration_s=15.0)
    monitor, found = monitor_of(recording.rig), []
    for begin in range(0, len(recording.time_s), block):
        time_s = recording.time_s[begin : begin + block]
        monitor.update(time_s, recording.force_g[begin : begin + block])
        if (begin + block) % 10 == 0:
            found.append(monitor.estimate(float(time_s[-1])))

    expected, in_tens = [], monitor_of(recording.rig)
    for begin in range(0, len(recording.time_s), 10):
        time_s = recording.time_s[begin : begin + 10]
        in_tens.update(time_s, recording.force_g[begin : begin + 10])
        expected.append(in_tens.estimate(float(time_s[-1])))
    assert [e.state for e in found] == [e.state for e in expected]
    known = [(e.angle_rad, f.angle_rad) for e, f in zip(found, expected, strict=True) if f.angle_rad is not None]
    assert len(known) > 40
    assert [a for a, _ in known] == pytest.approx([b for _, b in known], rel=1e-9)


def test_an_uncalibrated_sensor_at_the_load_states_no_angle() -> None:
    """There a constant axial reading is an offset or a steady circular swing."""
    recording = swing(duration_s=20.0, amplitude_deg=30.0, length_m=4.0, rho=1.0, noise_g=0.012, offset_g=0.02)
    rig = replace(recording.rig, zero_g_offset_u_g=(0.087, 0.087, 0.087), scale_u=(0.03, 0.03, 0.03))

    estimates = list(follow(replace(recording, rig=rig), monitor_of(rig)))

    assert all(estimate.angle_rad is None for estimate in estimates)
    assert "calibrate it" in estimates[-1].reasons[0]
