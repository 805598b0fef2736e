"""The messages of motion and swing over the simulated crane."""

import math
from itertools import pairwise

import pytest

from devices.simulated.schedule import Hoist, TrolleyMove
from gateway.messages import Motion, Swing
from tests.gateway.pipeline.test_pipeline import CLOCK, Run, crane
from tests.values import present

PERIOD_S = 2 * math.pi * math.sqrt(8.0 / 9.80665)
RIG = {"rope": {"length_m": 8.2}}


def times_s(messages: list[Motion] | list[Swing]) -> list[float]:
    return [message.time_ns / 1e9 for message in messages]


@pytest.fixture(scope="module")
def swinging() -> Run:
    return Run(crane(4.0), RIG).go(25)


@pytest.mark.slow
def test_motion_comes_ten_times_a_second(swinging: Run) -> None:
    steps_s = [after - before for before, after in pairwise(times_s(swinging.out["motion"]))]
    assert steps_s == pytest.approx([0.1] * len(steps_s), abs=0.02)


def test_the_angle_follows_the_rope(swinging: Run) -> None:
    motion: Motion = swinging.out["motion"][-1]
    assert motion.state == "free"
    assert motion.text.startswith("Free swing 4.0° ± 0.")
    assert motion.phi_max_deg == pytest.approx(4.0, abs=4 * present(motion.phi_max_u_deg) + 0.02)
    assert present(motion.angle_deg) < present(motion.phi_max_deg) + 0.05
    # a swing in one plane does not tell a shorter rope from one that hangs stiffer
    assert motion.length_m == pytest.approx(8.0, abs=2 * present(motion.length_u_m))
    assert present(motion.length_u_m) < 0.25
    assert motion.predicted_phi_max_deg == pytest.approx(4.0, abs=0.1)
    assert 0 <= present(motion.time_to_peak_s) <= PERIOD_S / 2 + 0.01


def test_the_rate_is_the_derivative_of_the_angle(swinging: Run) -> None:
    last: list[Motion] = swinging.out["motion"][-60:]
    for before, now, after in zip(last, last[1:], last[2:], strict=False):
        if present(now.angle_deg) > 1.0:  # elsewhere the angle passes its minimum
            step_s = (after.time_ns - before.time_ns) / 1e9
            slope_deg_s = (present(after.angle_deg) - present(before.angle_deg)) / step_s
            assert now.rate_deg_s == pytest.approx(slope_deg_s, abs=0.35)


def test_probabilities_obey_their_sum_rule(swinging: Run) -> None:
    for motion in swinging.out["motion"]:
        if motion.probabilities is not None:
            p = motion.probabilities
            assert p.free + p.driven + p.wind == pytest.approx(1.0)
            assert 0 <= p.hoisting <= 1


def test_swing_comes_about_three_times_a_period_and_agrees_with_the_motion(swinging: Run) -> None:
    swings: list[Swing] = [message for message in swinging.out["swing"] if message.swinging]
    steps_s = [after - before for before, after in pairwise(times_s(swings[3:]))]
    assert steps_s == pytest.approx([PERIOD_S / 3] * len(steps_s), abs=0.25)
    motions = {message.time_ns: message for message in swinging.out["motion"]}
    for swing in swings:
        motion: Motion = motions[swing.time_ns]
        assert swing.phi_max_deg == motion.phi_max_deg
        low_deg, high_deg = present(swing.coverage95_deg)
        half_deg = 1.96 * present(swing.u_deg)
        assert high_deg - present(swing.phi_max_deg) == pytest.approx(half_deg, rel=1e-3)
        assert low_deg == pytest.approx(max(0.0, present(swing.phi_max_deg) - half_deg), abs=1e-4)


def test_formulas_are_those_of_the_last_swing_as_published(swinging: Run) -> None:
    """At rho 0.625 the transverse formula reads the position of the housing into the angle."""
    formulas = swinging.out["swing"][-1].formulas_deg
    assert formulas.arcsin_max_axy == pytest.approx(4.0 * (1 - 5.0 / 8.0), rel=0.1)


@pytest.mark.slow
def test_a_load_at_rest_has_no_swing_and_an_upper_end() -> None:
    run = Run(crane()).go(15)
    swing: Swing = run.out["swing"][-1]
    assert (swing.swinging, run.out["motion"][-1].state) == (False, "rest")
    assert run.out["motion"][-1].text == "Load at rest."
    assert 0 < present(swing.coverage95_deg)[1] < 0.5
    late = times_s(run.out["swing"])[4:]
    assert [after - before for before, after in pairwise(late)] == pytest.approx([1.0] * (len(late) - 1), abs=0.11)


def test_before_the_first_angle_the_swing_is_unknown_with_a_reason() -> None:
    run = Run(crane(4.0)).go(1.5)
    swing, motion = run.out["swing"][-1], run.out["motion"][-1]
    assert (swing.swinging, swing.phi_max_deg, swing.coverage95_deg) == (None, None, None)
    assert swing.reasons == ["less than half a swing observed"]
    assert (motion.state, motion.angle_deg, motion.u_deg) == ("unknown", None, None)
    assert motion.text == "Swing not known: less than half a swing observed."


@pytest.mark.slow
def test_a_move_of_the_trolley_is_driven_and_trusted() -> None:
    run = Run(crane(1.0, events=[TrolleyMove(15.0, 8.0, 3.0, 1.2, 0.4)]), RIG).go(24)
    start_ns = run.blocks[0].time_ns[0] + CLOCK.wall_offset_ns
    ramp = [m for m in run.out["motion"] if 16.0 < (m.time_ns - start_ns) / 1e9 < 17.5]
    assert {m.state for m in ramp} == {"driven"}
    mean_m_s2 = sum(math.hypot(*present(m.pivot_accel_m_s2)) for m in ramp) / len(ramp)
    assert mean_m_s2 == pytest.approx(0.55, abs=0.15)  # 1.2 m/s in a smooth ramp of 3 s
    assert all(m.text.startswith("Trolley moving. Swing ") for m in ramp)
    judged = [c for c in run.out["condition"] if 16.4 < (c.time_ns - start_ns) / 1e9 < 17.5]
    assert {(c.verdict, c.cause, c.trusted) for c in judged} == {("driven", "trolley", True)}
    assert all(c.text.startswith("Trolley moving. Swing ") for c in judged)


@pytest.mark.slow
def test_a_hoist_is_named_with_its_speed() -> None:
    table = {"housing": {"above_load_m": 3.0}, **RIG}
    run = Run(crane(3.0, events=[Hoist(15.0, 8.0, -2.0)]), table).go(21)
    last = run.out["motion"][-10:]
    assert {m.state for m in last} == {"hoisting"}
    assert all(-0.6 < present(m.hoist_m_s) < -0.15 for m in last)
    assert all(m.text.startswith("Hoisting. Swing ") for m in last)


@pytest.mark.slow
def test_stale_readings_make_the_motion_unknown() -> None:
    run = Run(crane(3.0), RIG).go(10)
    assert run.out["motion"][-1].angle_deg is not None
    run.take(run.pipeline.idle(run.newest_ns + 2_000_000_000, CLOCK).messages)
    motion: Motion = run.out["motion"][-1]
    assert (motion.angle_deg, motion.state) == (None, "unknown")
    assert "stale" in motion.text
    run.go(0.5)
    assert run.out["motion"][-1].angle_deg is not None


@pytest.mark.slow
def test_long_blocks_give_the_same_messages_as_short_ones() -> None:
    """Blocks of one second: the updates keep their period."""
    short, long = Run(crane(4.0), RIG, block_samples=10).go(12), Run(crane(4.0), RIG, block_samples=100).go(12)
    assert len(long.out["motion"]) == pytest.approx(len(short.out["motion"]), abs=2)
    by_time = {m.time_ns // 100_000_000: m for m in short.out["motion"]}
    compared = [(m, by_time[m.time_ns // 100_000_000]) for m in long.out["motion"][40:-2]]
    for m, other in compared:
        assert m.angle_deg == pytest.approx(present(other.angle_deg), abs=0.2 + 0.05 * abs(present(other.rate_deg_s)))
    assert [m.sequence for m in long.out["motion"]] == list(range(len(long.out["motion"])))


def test_without_a_position_of_the_housing_only_the_tilt_is_known() -> None:
    run = Run(crane(), {"housing": {}, "device": {"kind": "replay", "path": "x.csv"}}).go(8)
    assert run.out["motion"][-1].reasons == ["where the housing is on the rope is not configured"]
    assert run.out["condition"][-1].verdict == "static"
    assert "swing" not in run.out
