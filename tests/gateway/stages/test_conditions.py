"""The gates on synthetic stretches whose condition is known."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.messages import MotionState
from gateway.messages.header import Reason
from gateway.stages.condition import ConditionResult, MotionContext, judge_condition
from gateway.stages.condition_window import ConditionWindow

RATE_HZ, NOISE_G, DM_G = 100.0, 0.0004, 0.002
Array = NDArray[np.float64]

STILL = MotionContext(state="rest", u_rad=0.001, phi_max_rad=0.002)
NOT_YET = MotionContext(state="unknown", reasons=(Reason("too_short", "less than half a swing observed"),))
REST = (0.0, 0.0, 1.0)


def stretch(
    seconds: float = 4.0, mean: tuple[float, ...] = REST, noise_g: float = NOISE_G, seed: int = 0
) -> tuple[Array, Array]:
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return time_s, np.random.default_rng(seed).normal(mean, noise_g, (len(time_s), 3))


def pendulum(phi_max_rad: float, rho: float, seconds: float = 4.0, period_s: float = 6.0) -> tuple[Array, Array]:
    """Planar swing of an ideal pendulum (small-angle phase, exact forces)."""
    time_s, force_g = stretch(seconds)
    phi = phi_max_rad * np.cos(2 * math.pi * time_s / period_s)
    force_g[:, 0] += (1 - rho) * np.sin(phi)
    force_g[:, 2] += np.cos(phi) - 1 + 2 * rho * (np.cos(phi) - math.cos(phi_max_rad))
    return time_s, force_g


def judged(
    time_s: Array,
    force_g: Array,
    swing: MotionContext = STILL,
    clipped: int = 0,
    missing: int = 0,
    block: int = 10,
) -> ConditionResult:
    window = ConditionWindow()
    for begin in range(0, len(time_s), block):
        window.update(time_s[begin : begin + block], force_g[begin : begin + block], clipped, missing)
    return judge_condition(window, swing, NOISE_G, DM_G)


def test_rest_is_static() -> None:
    found = judged(*stretch())
    assert (found.verdict, found.trusted) == ("static", True)
    assert found.norm_g == pytest.approx(1, abs=1e-3)


def test_a_cause_that_is_not_distinguishable_from_nothing_is_not_named() -> None:
    """A filter that finds a drive the likeliest, by less than its uncertainty, has found no drive."""
    moving = pendulum(math.radians(5), 0.3)
    drive = MotionContext(state="driven", u_rad=0.003, phi_max_rad=math.radians(6), amplitude_rad=math.radians(5))

    assert judged(*moving, swing=drive).cause == "trolley"
    faint = judged(*moving, swing=replace(drive, is_cause_distinct=False))
    assert (faint.verdict, faint.cause) == ("swinging", None)
    assert faint.gates["not_driven"]


def test_a_movement_that_counts_as_rest_is_not_called_too_little() -> None:
    rest = MotionContext(state="rest", u_rad=0.001, phi_max_rad=0.004, amplitude_rad=0.002)

    found = judged(*pendulum(0.05, 0.3), swing=rest)
    assert found.verdict == "swinging"
    assert found.reasons[0] == "moves, but by no more than what counts as rest"


def test_a_lean_is_static_too() -> None:
    lean = math.radians(20)
    assert judged(*stretch(mean=(math.sin(lean), 0, math.cos(lean)))).verdict == "static"


DRIVEN = MotionContext(
    state="driven",
    u_rad=0.005,
    phi_max_rad=math.radians(8),
    rho=0.5,
    period_s=6.0,
    reasons=(Reason("pivot_accelerates", "the pivot accelerates"),),
)


@pytest.mark.parametrize(("state", "cause"), [("driven", "trolley"), ("hoisting", "hoisting"), ("wind", "wind")])
def test_ordinary_work_of_the_crane_is_driven_and_trusted(state: MotionState, cause: str) -> None:
    time_s, force_g = pendulum(math.radians(8), 0.5)
    force_g[:, 0] += 0.03 * np.sin(math.pi * time_s / 2) ** 2
    found = judged(time_s, force_g, replace(DRIVEN, state=state))
    assert (found.verdict, found.cause, found.trusted) == ("driven", cause, True)
    assert found.reasons == ("the pivot accelerates",)


@pytest.mark.parametrize("state", ["driven", "free"])
def test_an_angle_that_is_hardly_known_is_not_trusted(state: MotionState) -> None:
    found = judged(*pendulum(math.radians(8), 0.5), replace(DRIVEN, state=state, u_rad=math.radians(1.6)))
    assert (found.verdict, found.trusted, found.gates["angle_known"]) == ("unknown", False, False)


def test_readings_that_no_motion_explains_are_disturbed() -> None:
    found = judged(*pendulum(math.radians(8), 0.5), replace(DRIVEN, is_explained=False))
    assert (found.verdict, found.trusted) == ("disturbed", False)
    assert "explains" in found.reasons[0]


def test_a_faint_swing_is_no_rest() -> None:
    assert judged(*pendulum(math.radians(0.12), 0.02), STILL).verdict == "swinging"


def test_vibration_about_a_steady_mean_is_quasi_static() -> None:
    time_s, force_g = stretch()
    force_g[:, 1] += 0.02 * np.sin(2 * math.pi * 30 * time_s)
    assert judged(time_s, force_g).verdict == "quasi_static"


@pytest.mark.parametrize("rho", [0.02, 0.5, 1.0])
@pytest.mark.parametrize("phi_max_deg", [2.0, 8.0, 15.0])
def test_a_pendulum_is_swinging_at_every_mounting(rho: float, phi_max_deg: float) -> None:
    phi_max_rad = math.radians(phi_max_deg)
    seen = MotionContext(state="free", u_rad=0.001, phi_max_rad=phi_max_rad, rho=rho)
    found = judged(*pendulum(phi_max_rad, rho), seen)
    assert (found.verdict, found.cause, found.trusted) == ("swinging", None, True)


def test_the_condition_is_unknown_before_a_full_swing() -> None:
    found = judged(*pendulum(0.1, 0.5), NOT_YET)
    assert (found.verdict, found.trusted) == ("unknown", False)
    assert judged(*stretch(seconds=0.5), NOT_YET).verdict == "unknown"


DISTURBANCES: dict[str, Callable[[Array, Array], Array]] = {
    "free fall": lambda _, f: f * 0.01,
    "wrong scale": lambda _, f: f * 1.05,
    "upside down and not level": lambda t, f: 1.01 * -f,
}


@pytest.mark.parametrize("name", DISTURBANCES)
def test_what_no_hanging_load_does_is_disturbed(name: str) -> None:
    time_s, force_g = stretch()
    found = judged(time_s, DISTURBANCES[name](time_s, force_g))
    assert (found.verdict, found.trusted) == ("disturbed", False)
    assert not judged(time_s, DISTURBANCES[name](time_s, force_g), NOT_YET).trusted


def test_free_fall_is_no_drive() -> None:
    time_s, force_g = stretch()
    assert judged(time_s, DISTURBANCES["free fall"](time_s, force_g), DRIVEN).verdict == "disturbed"


@pytest.mark.parametrize("step_g", [(0.0, 0.0, 0.03), (0.05, 0.0, 0.0)])
def test_motion_that_is_not_known_is_never_static(step_g: tuple[float, float, float]) -> None:
    time_s, force_g = stretch()
    found = judged(time_s, force_g + np.outer(time_s > 3, step_g), NOT_YET)
    assert (found.verdict, found.trusted) == ("unknown", False)


def test_an_impact_is_named() -> None:
    time_s, force_g = stretch()
    force_g[300] += [0.5, 0, 0]
    found = judged(time_s, force_g)
    assert found.verdict == "disturbed"
    assert found.cause == "impact"
    assert "impact" in found.reasons[0]


def test_vibration_is_named_and_too_much_of_it_disturbs() -> None:
    time_s, force_g = stretch()
    wave = np.outer(np.sin(2 * math.pi * 30 * time_s), [0, 1.0, 0])
    mild, strong = judged(time_s, force_g + 0.05 * wave), judged(time_s, force_g + 0.4 * wave)
    assert (mild.verdict, mild.cause) == ("quasi_static", "vibration")
    assert (strong.verdict, strong.cause) == ("disturbed", "vibration")


def test_an_impact_is_detected_within_vibration() -> None:
    time_s, force_g = stretch()
    force_g[:, 1] += 0.12 * np.sin(2 * math.pi * 30 * time_s)
    assert judged(time_s, force_g).cause == "vibration"
    force_g[350] += [1.0, 0, 0]
    assert judged(time_s, force_g).cause == "impact"


def test_a_swing_at_its_turning_point_is_not_static() -> None:
    """A rope of 40 m: for two seconds nothing seems to move."""
    time_s, force_g = pendulum(math.radians(0.4), 0.9, seconds=2.1, period_s=12.7)
    assert judged(time_s, force_g, NOT_YET).verdict == "unknown"
    settled = replace(STILL, amplitude_rad=0.0002, rho=0.5)
    assert judged(time_s, force_g, settled).verdict == "static"
    assert judged(*stretch(seconds=2.1), NOT_YET).verdict == "unknown"
    assert judged(*stretch(seconds=5.0), NOT_YET).verdict == "static"


def test_a_load_is_not_static_seconds_after_a_movement() -> None:
    time_s, force_g = stretch(seconds=5.0)
    force_g[:, 0] += np.where(time_s < 2, 0.02, 0.0)
    found = judged(time_s, force_g)
    assert (found.gates["still"], found.gates["steady"], found.verdict) == (True, False, "swinging")
    assert judged(time_s, force_g, NOT_YET).verdict == "unknown"
    settled = replace(STILL, amplitude_rad=0.0002, rho=0.5)
    assert judged(time_s, force_g, settled).verdict == "static"


def test_a_window_lasts_two_seconds_at_every_rate() -> None:
    for rate_hz in (50.0, 100.0, 1000.0):
        window, n = ConditionWindow(), round(rate_hz / 10)
        for block in range(60):
            time_s = (block * n + np.arange(n)) / rate_hz
            window.update(time_s, np.tile(REST, (n, 1)), int(block == 35), 0)
            found = judge_condition(window, STILL, NOISE_G, DM_G) if block > 12 else None
            if found is not None:
                assert found.gates["not_clipped"] == (not 35 <= block < 55)


def test_clipping_and_missing_samples_are_named() -> None:
    assert "clipped" in judged(*stretch(), clipped=1).reasons[0]
    found = judged(*stretch(), missing=2)
    assert (found.verdict, "missing" in found.reasons[0]) == ("unknown", True)


def test_a_dead_axis_is_named() -> None:
    time_s, force_g = stretch()
    force_g[:, 1] = 0.0
    found = judged(time_s, force_g)
    assert (found.verdict, found.reasons) == ("unknown", ("an axis reads exactly zero",))


def test_a_gap_clears_the_window() -> None:
    time_s, force_g = stretch()
    window = ConditionWindow()
    window.update(time_s, force_g, 0, 0)
    window.update(time_s[:10] + 60.0, force_g[:10], 0, 0)
    assert judge_condition(window, STILL, NOISE_G, DM_G).verdict == "unknown"


def test_no_bin_spans_a_gap() -> None:
    window, time_s = ConditionWindow(), np.arange(5) / RATE_HZ
    window.update(time_s, np.tile(REST, (5, 1)), 0, 0)
    window.update(time_s + 1.0, np.tile((0.1, 0.0, 1.0), (5, 1)), 0, 95)
    window.update(time_s + 1.05, np.tile((0.1, 0.0, 1.0), (5, 1)), 0, 0)
    assert [(each.mean_g[0], each.missing) for each in window.bins] == [(0.0, 0), (pytest.approx(0.1), 95)]


def test_a_constant_acceleration_with_unit_norm_is_not_detectable() -> None:
    """Łuczak n.d., Fig. 2: a constant acceleration of -2 g upright leaves |m| = 1 and turns the reading by 180 degrees.

    No accelerometer alone can tell; the gates call it static, and the docs say so.
    """
    assert judged(*stretch(mean=(0.0, 0.0, -1.0))).verdict == "static"
