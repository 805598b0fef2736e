"""The generator of working-crane recordings against closed forms."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipk

from tests.blind.mechanics import Array, Hook
from tests.working_crane.__main__ import main, make
from tests.working_crane.commands import commands
from tests.working_crane.crane import DURATION_S, G_M_S2, RATE_HZ, Crane, HeavyRope, Jib
from tests.working_crane.engine import Motion, simulate, step_s
from tests.working_crane.events import Drive, Event, Gust, Hoist, JibTrolley, Luff, Slew, SteppedHoist
from tests.working_crane.kinds import KINDS, case_seeds

FREE = Crane(length_m=12.0, above_load_m=5.0, damping_ratio=0.0)
DRIVE = Drive(1.0, 4.0, 2.0, 1.5, 0.6)
READ_BY_SCORE = {"time_s", "angle_deg", "driven", "hoisting", "gust"}


def run(crane: Crane, events: tuple[Event, ...], duration_s: float, tilt_rad: float = 0.0) -> tuple[Array, Motion]:
    half_s = step_s(crane) / 2
    time_s: Array = half_s * np.arange(2 * round(duration_s / step_s(crane)), dtype=np.float64)
    return time_s[::2], simulate(crane, commands(crane, events, (0.0, 0.0), time_s), (tilt_rad, 0.0))


def derivative(values: Array, interval_s: float) -> Array:
    """Central differences of fourth order; the two rows at each end are lost."""
    differences: Array = values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]
    return differences / (12 * interval_s)


def across(vectors: Array, direction: Array) -> Array:
    along: Array = direction * np.sum(vectors * direction, axis=1)[:, None]
    return vectors - along


@pytest.mark.slow
@pytest.mark.parametrize("amplitude_rad", [0.02, 0.3])
def test_free_swing_has_the_period_of_the_elliptic_integral(amplitude_rad: float) -> None:
    time_s, motion = run(FREE, (), 60.0, amplitude_rad)
    x = motion.direction[:, 0]
    after = np.flatnonzero(x[:-1] * x[1:] < 0)
    crossings_s = time_s[after] - x[after] * (time_s[after + 1] - time_s[after]) / (x[after + 1] - x[after])
    period_s = 2 * (crossings_s[-1] - crossings_s[0]) / (len(crossings_s) - 1)
    expected_s = 4 * np.sqrt(FREE.length_m / G_M_S2) * ellipk(np.sin(amplitude_rad / 2) ** 2)
    assert period_s == pytest.approx(expected_s, rel=1e-6)


@pytest.mark.slow
def test_viscous_damping_has_the_stated_ratio() -> None:
    crane = replace(FREE, damping_ratio=0.005)
    duration_s = 10 * 2 * np.pi / crane.rate_rad_s
    _, motion = run(crane, (), duration_s, 0.02)
    assert motion.direction[-1, 0] / 0.02 == pytest.approx(np.exp(-0.005 * crane.rate_rad_s * duration_s), rel=1e-3)


def test_transverse_reading_is_the_rope_s_angular_acceleration_while_the_crane_moves() -> None:
    """P f = -d P n'' whatever trolley and winch do."""
    time_s, motion = run(FREE, (DRIVE, Hoist(2.0, 5.0, -1.2)), 12.0, 0.05)
    acceleration = derivative(motion.direction_rate, step_s(FREE))
    expected = -FREE.above_load_m * across(acceleration, motion.direction[2:-2])
    # The reading is in the rope's frame: without a turn about the rope both have the same length and the same start.
    size = np.linalg.norm(motion.force_m_s2[2:-2, :2], axis=1)
    np.testing.assert_allclose(size, np.linalg.norm(expected, axis=1), atol=2e-5)
    assert size.max() > 0.2
    assert time_s[-1] == pytest.approx(11.99)


def test_wind_adds_the_force_on_the_load_to_the_transverse_reading() -> None:
    gust = Gust(1.0, 8.0, 0.1, 0.0)
    time_s, motion = run(FREE, (gust,), 10.0)
    n = motion.direction[2:-2]
    force = np.outer(gust.force(time_s[2:-2]), [1.0, 0.0, 0.0])
    acceleration = derivative(motion.direction_rate, step_s(FREE))
    expected = across(force - FREE.above_load_m * acceleration, n)
    np.testing.assert_allclose(motion.force_m_s2[2:-2, 0], expected[:, 0] / -n[:, 2], atol=2e-5)


def test_rope_obeys_the_equation_of_motion_with_every_command() -> None:
    """L P n'' + 2 L' n' = P (g - a)."""
    crane = replace(FREE, jib=Jib(boom_m=30.0, elevation_rad=0.9))
    events = (Luff(0.5, 3.0, 2.0, 0.02), Slew(1.0, 3.0, 3.0, 0.06), Hoist(2.0, 5.0, 1.5), DRIVE)
    time_s, motion = run(crane, events, 12.0, 0.03)
    given = commands(crane, events, (0.0, 0.0), time_s)
    n, rate = motion.direction[2:-2], motion.direction_rate[2:-2]
    length = (crane.length_m + motion.paid_out_m[2:-2])[:, None]
    left = length * across(derivative(motion.direction_rate, step_s(crane)), n) + 2 * given.hoist_m_s[2:-2, None] * rate
    right = across(np.array([0.0, 0.0, -G_M_S2]) - given.pivot_m_s2[2:-2], n)
    np.testing.assert_allclose(left, right, atol=5e-5)


def test_rope_is_paid_out_as_commanded() -> None:
    hoist, steps = Hoist(1.0, 5.0, 1.5), SteppedHoist(7.0, 0.3, (2.0, 3.0), (-0.1, -0.4))
    _, motion = run(FREE, (hoist, steps), 15.0, 0.1)
    assert motion.paid_out_m[-1] == pytest.approx(hoist.by_m + steps.by_m, abs=1e-5)
    assert steps.by_m == pytest.approx(-1.4)


def test_jib_s_pivot_acceleration_is_the_second_derivative_of_its_path() -> None:
    crane = replace(FREE, jib=Jib(radius_m=30.0))
    turn, trolley = Slew(0.5, 3.0, 2.0, 0.07), JibTrolley(1.0, 2.0, 3.0, 1.0)
    interval_s = 0.002
    time_s: Array = interval_s * np.arange(6000, dtype=np.float64)
    angle, radius = turn.motion.displacement(time_s), 30 + trolley.motion.displacement(time_s)
    path = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle])
    given = commands(crane, (turn, trolley), (0.0, 0.0), time_s)
    expected = derivative(derivative(path, interval_s), interval_s)
    np.testing.assert_allclose(given.pivot_m_s2[4:-4], expected, atol=1e-5)
    np.testing.assert_allclose(given.heading_rad, angle)


@pytest.mark.slow
def test_heavy_rope_swings_and_vibrates_at_its_own_frequencies() -> None:
    rope = HeavyRope(mass_ratio=0.05, damping_1_s=0.0)
    crane = replace(FREE, above_load_m=6.0, rope=rope)
    _, motion = run(crane, (Drive(0.5, 0.3, 60.0, 0.3, 0.0),), 40.0)
    spectrum = np.abs(np.fft.rfft(np.hanning(len(motion.force_m_s2)) * motion.force_m_s2[:, 0]))
    frequency_hz = np.fft.rfftfreq(len(motion.force_m_s2), step_s(crane))
    string_hz = np.sqrt(G_M_S2 * (1 + rope.mass_ratio / 2) / (crane.length_m * rope.mass_ratio)) / 2
    near = (frequency_hz > 0.8 * string_hz) & (frequency_hz < 1.3 * string_hz)
    found_hz = frequency_hz[near][np.argmax(spectrum[near])]
    assert found_hz == pytest.approx(string_hz * (1 + rope.mass_ratio / np.pi**2), rel=0.03)


@pytest.mark.slow
def test_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        main([str(tmp_path / folder), "--seed", "3", "--count", "1"])
    names = sorted(path.name for path in (tmp_path / "a" / "work_000").iterdir())
    assert names == ["case.json", "gateway.toml", "log.csv", "truth.csv"]
    for name in names:
        assert (tmp_path / "a/work_000" / name).read_bytes() == (tmp_path / "b/work_000" / name).read_bytes()


@pytest.mark.slow
def test_files_hold_what_the_score_reads(tmp_path: Path) -> None:
    main([str(tmp_path), "--seed", "4", "--count", "1", "--kind", "hook"])
    folder = tmp_path / "work_000"
    facts = json.loads((folder / "case.json").read_text())
    assert {"length_m", "rho", "noise_g", "hook", "events", "kind"} <= facts.keys()
    assert facts["hook"].keys() == {"rigging_length_m", "hook_mass_ratio", "initial_deg"}
    with (folder / "truth.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0].keys() >= READ_BY_SCORE
    assert len(rows) == DURATION_S * RATE_HZ
    assert {row["driven"] for row in rows} == {"0", "1"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_draws_events_in_order_and_leaves_the_housing_below_the_pivot(kind: str) -> None:
    for seed in case_seeds(11, 20):
        case = KINDS[kind](seed)
        starts_s = [event.start_s for event in case.events]
        assert starts_s == sorted(starts_s)
        changes_m = np.cumsum([event.by_m for event in case.events if isinstance(event, Hoist | SteppedHoist)])
        assert case.crane.length_m + min(changes_m, default=0.0) > case.crane.above_load_m
        assert case.kind == kind


@pytest.mark.slow
def test_hook_and_load_swing_at_the_frequencies_of_the_double_pendulum() -> None:
    upper_m, lower_m, ratio = 10.0, 2.0, 0.1
    crane = replace(FREE, hook=Hook(lower_m, ratio))
    half_s = step_s(crane) / 2
    time_s: Array = half_s * np.arange(round(120 / half_s), dtype=np.float64)
    motion = simulate(crane, commands(crane, (), (0.0, 0.0), time_s), (0.01, 0.0), (0.05, 0.0))
    x = motion.direction[:, 0]
    spectrum, frequency_hz = np.abs(np.fft.rfft(np.hanning(len(x)) * x)), np.fft.rfftfreq(len(x), step_s(crane))
    share, lengths = 1 + 1 / ratio, 1 / upper_m + 1 / lower_m
    root = np.sqrt(share**2 * lengths**2 - 4 * share / (upper_m * lower_m))
    for sign, low_hz, high_hz in ((-1, 0.0, 0.5), (1, 0.5, 5.0)):
        expected_hz = np.sqrt(G_M_S2 / 2 * (share * lengths + sign * root)) / (2 * np.pi)
        near = (frequency_hz > low_hz) & (frequency_hz < high_hz)
        assert frequency_hz[near][np.argmax(spectrum[near])] == pytest.approx(expected_hz, abs=0.009)


@pytest.mark.slow
def test_lost_samples_leave_the_truth_complete() -> None:
    case, recording = make("faults", case_seeds(12, 1)[0])
    gaps_s = [fault.duration_s for fault in case.sensor.faults if fault.kind == "gap"]
    assert len(recording.truth["time_s"]) == DURATION_S * RATE_HZ
    assert len(recording.time_s) < DURATION_S * RATE_HZ - RATE_HZ * max(gaps_s) + 1
    assert np.abs(recording.reading_g).max() <= case.sensor.full_scale_g


@pytest.mark.slow
def test_recording_may_begin_in_the_middle_of_a_ramp() -> None:
    case, recording = make("mid_manoeuvre", case_seeds(13, 1)[0])
    assert recording.truth["driven"][0] == 1
    assert recording.truth["rate_deg_s"][0] > 0.1
    assert case.lead_in_s > 0
