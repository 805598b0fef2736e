"""Each effect against what is known of it without integration."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from devices.pendulum import pendulum
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.simulated.crane import Crane
from gateway.twin.effects import EFFECTS, Values
from gateway.twin.effects.evaluation_context import EvaluationContext, RopeGeometry
from gateway.twin.effects.pulse import Pulse
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.compiled_model import IntegrationError
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.swings import (
    LENGTH_M,
    PERIOD_S,
    POSITION_M,
    RIG,
    SWING_RATE,
    Array,
    G,
    at_pivot,
    predicted,
    rope_angle,
)

TIME_S = np.arange(0, 60, 0.02)
START = (0.1, -0.04, 0.01, 0.02, 0.0)
HOISTED_M = 0.3 * 8.0 * (1 - 0.1 / 2)
"""0.3 m/s for 8 s, a tenth of it rising and falling."""
VOCABULARY = {  # of the published interface
    "viscous_damping",
    "quadratic_drag",
    "coulomb_friction",
    "steady_wind",
    "wind_gust",
    "hoisting",
    "trolley_acceleration",
    "slewing",
    "double_pendulum",
    "housing_position",
    "lever_arm",
    "housing_rocking",
    "housing_torsion",
    "sample_hold",
    "rope_length",
    "rope_stretch",
    "housing_spin",
    "impact",
    "load_change",
    "load_inertia",
    "rope_mass",
    "pivot_compliance",
    "pivot_friction",
    "axis_offset",
    "scale_error",
    "cross_axis",
    "mount_misalignment",
    "thermal_drift",
    "lowpass_lag",
    "clipping",
    "quantization",
    "clock_drift",
    "sample_loss",
    "vibration",
}


def plain(time_s: Array = TIME_S, rig: TwinRig = RIG) -> Array:
    return predicted(rig, {}, START, time_s)


def test_vocabulary_is_complete_and_each_effect_is_described() -> None:
    assert set(EFFECTS) == VOCABULARY
    for name, effect in EFFECTS.items():
        assert effect.name == name
        assert all((effect.equation, effect.explains, effect.reference, effect.enters))


def test_samples_at_uneven_times_belong_to_the_same_motion() -> None:
    random = np.random.default_rng(3)
    some = np.sort(random.choice(len(TIME_S), 700, replace=False))
    some[0] = 0
    assert plain(TIME_S[some]) == pytest.approx(plain()[some], abs=1e-6)


def test_impact_changes_the_velocity_at_its_time_and_not_before() -> None:
    effects: EffectValues = {"impact": {"delta_v_m_s": (0.1, -0.05), "start_s": 20.013}}
    struck = predicted(RIG, effects, START, TIME_S)
    assert struck[TIME_S < 20.013] == pytest.approx(plain()[TIME_S < 20.013], abs=1e-8)
    hanging = predicted(at_pivot(), effects, np.zeros(5), TIME_S)
    after = TIME_S[TIME_S > 20.02] - 20.013
    tilt = np.arctan2(hanging[TIME_S > 20.02, 0], hanging[TIME_S > 20.02, 2])
    assert tilt == pytest.approx(0.1 / (LENGTH_M * SWING_RATE) * np.sin(SWING_RATE * after), abs=1e-5)


def test_swing_after_a_gust_follows_from_the_spectrum_of_the_gust() -> None:
    """A (1 - cos)/2 push of width T at a resting load leaves a/w^2 |spectrum at w| of it."""
    width_s, push = 3.0, 0.2
    effects: EffectValues = {"wind_gust": {"accel_m_s2": (push, 0.0), "start_s": 10.0, "duration_s": width_s}}
    force = predicted(at_pivot(), effects, np.zeros(5), TIME_S)
    inside = np.linspace(0, width_s, 20001)
    shape = (1 - np.cos(2 * np.pi * inside / width_s)) / 2
    spectrum = abs(np.mean(shape * np.exp(-1j * SWING_RATE * inside))) * width_s
    assert rope_angle(force[TIME_S > 14]).max() == pytest.approx(push * spectrum / (LENGTH_M * SWING_RATE), rel=1e-3)


def test_trolley_ramps_of_one_period_leave_no_swing() -> None:
    effects: EffectValues = {
        # half of the hundredth in which a ramp rises and falls takes off its area: the rest lasts one period
        "trolley_acceleration": {
            "accel_m_s2": (0.2, 0.0),
            "start_s": 5.0,
            "duration_s": PERIOD_S / 0.995,
            "coast_s": 4.0,
        }
    }
    force = predicted(at_pivot(), effects, np.zeros(5), TIME_S)
    quiet = TIME_S > 5.0 + 2 * PERIOD_S / 0.995 + 4.0 + 0.1  # ramps of one period each leave no swing
    assert rope_angle(force[quiet]).max() < 2e-4
    moving = (TIME_S > 5.0) & (TIME_S < 5.0 + PERIOD_S)
    assert np.arctan2(*(force[moving].T[[0, 2]])).max() == pytest.approx(0.2 / G, rel=0.01)


def test_hoisting_conserves_the_angular_momentum_about_the_vertical() -> None:
    effects: EffectValues = {"hoisting": {"speed_m_s": -0.3, "start_s": 10.0, "duration_s": 8.0}}
    simulator = Simulator(RIG, tuple(effects))
    values = simulator.values([0.05, 0.0, 0.0, 0.06], effects)
    ends = simulator.linearise_segments(values[None, :5], values[5:], TIME_S, [0]).ends[0]
    n = np.array([np.sin(ends[0]) * np.cos(ends[1]), np.sin(ends[1])])
    rates = np.array(
        [
            ends[2] * np.cos(ends[0]) * np.cos(ends[1]) - ends[3] * np.sin(ends[0]) * np.sin(ends[1]),
            ends[3] * np.cos(ends[1]),
        ]
    )
    before = LENGTH_M**2 * np.sin(0.05) * 0.06
    assert (LENGTH_M - HOISTED_M) ** 2 * (n[0] * rates[1] - n[1] * rates[0]) == pytest.approx(before, rel=3e-6)


def test_housing_keeps_its_distance_to_the_load_during_hoisting() -> None:
    effects: EffectValues = {"hoisting": {"speed_m_s": -0.3, "start_s": 10.0, "duration_s": 8.0}}
    simulator = Simulator(RIG, tuple(effects))
    values = simulator.values(START, effects)
    there = simulator.linearise_segments(np.stack([values[:5]] * 2), values[5:], TIME_S, [0, 1000]).ends[0]
    later = predicted(TwinRig(LENGTH_M - HOISTED_M, POSITION_M - HOISTED_M), {}, there, TIME_S[1000:])
    assert predicted(RIG, effects, START, TIME_S)[1000:] == pytest.approx(later, abs=1e-6)


def test_slewing_equals_a_free_pendulum_in_a_rotating_frame() -> None:
    rate = np.radians(3.0)
    tilt, speed = 0.1, 0.03
    turning = predicted(
        RIG, {"slewing": {"rate_deg_s": 3.0}}, [tilt, 0, 0, speed - rate * np.tan(tilt) * np.cos(tilt)], TIME_S
    )
    free = predicted(RIG, {}, [tilt, 0, 0, speed], TIME_S)
    assert turning[:, 2] == pytest.approx(free[:, 2], abs=1e-7)
    assert np.hypot(*turning[:, :2].T) == pytest.approx(np.hypot(*free[:, :2].T), abs=1e-7)
    turned = np.unwrap(np.angle((turning[:, 0] + 1j * turning[:, 1]) / (free[:, 0] + 1j * free[:, 1])))
    assert turned[-1] - turned[0] == pytest.approx(-rate * TIME_S[-1], rel=0.01)


def test_housing_spin_rotates_the_readings() -> None:
    spun = predicted(RIG, {"housing_spin": {"rate_deg_s": 4.0}}, START, TIME_S)
    turned = (plain()[:, 0] + 1j * plain()[:, 1]) * np.exp(-1j * np.radians(4.0) * TIME_S)
    assert spun[:, 0] + 1j * spun[:, 1] == pytest.approx(turned, abs=1e-9)


@pytest.mark.slow
def test_errors_of_nominal_lengths_equal_another_rig() -> None:
    longer = predicted(TwinRig(LENGTH_M * 1.03, POSITION_M), {}, START, TIME_S)
    assert predicted(RIG, {"rope_length": {"relative_error": 0.03}}, START, TIME_S) == pytest.approx(longer, abs=1e-6)
    from_load = replace(RIG, is_placed_from_load=True)
    along = predicted(TwinRig(LENGTH_M * 1.03, POSITION_M + 0.03 * LENGTH_M), {}, START, TIME_S)
    assert predicted(from_load, {"rope_length": {"relative_error": 0.03}}, START, TIME_S) == pytest.approx(
        along, abs=1e-6
    )
    lower = predicted(TwinRig(LENGTH_M, POSITION_M + 0.7), {}, START, TIME_S)
    assert predicted(RIG, {"housing_position": {"error_m": 0.7}}, START, TIME_S) == pytest.approx(lower, abs=1e-9)


def test_a_change_of_the_length_leaves_the_inertia_of_the_load() -> None:
    geometry = RopeGeometry(
        (LENGTH_M, 0.0, 0.0), (POSITION_M, 0.0, 0.0), gyration_squared_m2=0.5, is_placed_from_load=True
    )
    changed = geometry.with_changes((-2.0, -0.3), (-1.0,))
    lengths = (LENGTH_M - 2.0, -0.3, 0.0), (POSITION_M - 1.0, 0.0, 0.0)
    assert changed == RopeGeometry(*lengths, gyration_squared_m2=0.5, is_placed_from_load=True)


def test_load_change_changes_the_length_at_once() -> None:
    effects: EffectValues = {"load_change": {"length_change_m": -2.0, "start_s": 1e-3}}
    changed = predicted(RIG, effects, START, TIME_S)
    assert changed[1:] == pytest.approx(predicted(TwinRig(LENGTH_M - 2.0, POSITION_M), {}, START, TIME_S)[1:], abs=1e-4)


def test_clock_drift_and_sample_loss_scale_time() -> None:
    stretched = predicted(RIG, {"clock_drift": {"relative": 0.01}}, START, TIME_S)
    assert stretched == pytest.approx(plain(TIME_S / 1.01), abs=1e-6)
    lossy = predicted(RIG, {"sample_loss": {"fraction": 0.03}}, START, TIME_S)
    assert lossy == pytest.approx(plain(TIME_S / 0.97), abs=1e-6)


@pytest.mark.slow
def test_sensor_effects_act_in_the_order_of_the_chain() -> None:
    force = plain()
    x, y, z = force.T
    read = predicted(RIG, {"cross_axis": {"xy": 0.01, "xz": -0.02, "yz": 0.03}}, START, TIME_S)
    assert read == pytest.approx(force @ np.array([[1, 0.01, -0.02], [0.01, 1, 0.03], [-0.02, 0.03, 1]]), abs=1e-12)
    chain: EffectValues = {
        "axis_offset": {"offset_g": (0.1, 0.2, 0.3)},
        "scale_error": {"relative": (0.01, -0.02, 0.03)},
    }
    expected = np.stack([1.01 * x + 0.1, 0.98 * y + 0.2, 1.03 * z + 0.3], axis=1)
    assert predicted(RIG, chain, START, TIME_S) == pytest.approx(expected, abs=1e-12)
    clipped = predicted(RIG, {**chain, "clipping": {"full_scale_g": 0.25}}, START, TIME_S)
    assert clipped == pytest.approx(np.clip(expected, -0.25, 0.25), abs=1e-12)
    tilted = predicted(RIG, {"mount_misalignment": {"deg": (1.0, 0.0)}}, START, TIME_S)
    assert np.linalg.norm(tilted, axis=1) == pytest.approx(np.linalg.norm(force, axis=1), abs=1e-12)
    assert tilted[:, 0] == pytest.approx(x, abs=1e-12)


def test_thermal_drift_is_proportional_to_the_temperature_rise() -> None:
    temperature_c = 22 + TIME_S / 3
    drifted = predicted(RIG, {"thermal_drift": {"mg_per_c": (1.0, 0.0, -2.0)}}, START, TIME_S, temperature_c)
    moved = np.outer(TIME_S / 3, [1e-3, 0.0, -2e-3])
    assert drifted - plain() == pytest.approx(moved, abs=1e-12)
    with pytest.raises(ValueError, match="needs temperature_c"):
        predicted(RIG, {"thermal_drift": {"mg_per_c": (1.0, 0.0, 0.0)}}, START, TIME_S)


@pytest.mark.parametrize("cutoff_hz", [0.4, 2.0])
def test_lowpass_lag_has_the_gain_and_phase_of_one_pole(cutoff_hz: float) -> None:
    effects: EffectValues = {
        "lowpass_lag": {"cutoff_hz": cutoff_hz},
        "vibration": {"frequency_hz": 0.9, "amplitude_g": (0.1, 0.0, 0.0), "phase_rad": 0.0},
    }
    force = predicted(RIG, effects, np.zeros(5), TIME_S)[:, 0]
    gain = 1 / (1 + 1j * 0.9 / cutoff_hz)
    settled = TIME_S > 10
    expected = 0.1 * np.imag(gain * np.exp(2j * np.pi * 0.9 * TIME_S))
    assert force[settled] == pytest.approx(expected[settled], abs=2e-4)


def test_initial_state_of_the_lowpass_decays() -> None:
    began_g, time_s = np.array([0.01, -0.02, 0.005]), TIME_S[TIME_S < 3]
    settled, other = (
        predicted(RIG, {"lowpass_lag": {"cutoff_hz": 0.5, "began_g": tuple(began)}}, START, time_s)
        for began in (np.zeros(3), began_g)
    )
    assert other - settled == pytest.approx(np.exp(-np.pi * time_s)[:, None] * began_g, abs=1e-12)


def test_two_structures_exclude_each_other() -> None:
    with pytest.raises(ValueError, match="cannot act together"):
        Simulator(RIG, ("double_pendulum", "rope_stretch"))


def test_twin_and_simulated_crane_have_the_same_motion() -> None:
    start = (0.12, -0.03, 0.01, 0.05)
    time_s = np.arange(0, 40, 0.02)
    crane = Crane(length_m=9.0, position_m=6.0, motion=pendulum.start_motion(*start), damping_ratio=0.01)
    simulator = Simulator(TwinRig(9.0, 6.0), ("viscous_damping",))
    found = simulator.predict(simulator.values(start, {"viscous_damping": {"damping_ratio": 0.01}}), time_s)
    assert found * crane.gravity_m_s2 == pytest.approx(crane.specific_force_m_s2(time_s), abs=2e-5)


def test_times_and_parameters_that_cannot_be_integrated_are_refused() -> None:
    simulator = Simulator(RIG, ("rope_stretch",))
    for frequency_hz in (-1.0, np.nan):
        values = simulator.values(np.zeros(7), {"rope_stretch": {"frequency_hz": frequency_hz}})
        with pytest.raises(IntegrationError, match="keep them inside their bounds"):
            simulator.predict(values, TIME_S)
    for times in (TIME_S[:1], TIME_S[::-1], np.zeros(3)):
        with pytest.raises(ValueError, match="each later than the one before"):
            Simulator(RIG).predict(np.zeros(5), times)


def test_bound_of_the_rigging_length_depends_on_the_rope() -> None:
    bounds = {slot.label: slot.upper for slot in Simulator(TwinRig(3.0, 1.0), ("double_pendulum",)).effect_parameters}
    assert bounds["double_pendulum.rigging_length_m"] == pytest.approx(0.95 * 3.0)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.02, 0.4, 1.0])
def test_integral_and_slope_of_a_pulse_agree_with_its_value(share: float) -> None:
    pulse = Pulse(2.0, 3.0, share)
    time_s = np.linspace(0, 7, 70_001)
    level, area, slope = (
        np.array([float(each(EvaluationContext(t, t, STANDARD_GRAVITY_M_S2))) for t in time_s])
        for each in (pulse.value, pulse.integral, pulse.slope)
    )

    assert level.max() == pytest.approx(1.0)
    assert level[(time_s < 2) | (time_s > 5)].max() == 0.0
    assert area[-1] == pytest.approx(3.0 * (1 - share / 2), rel=1e-9)
    np.testing.assert_allclose(np.diff(area), 1e-4 * (level[1:] + level[:-1]) / 2, atol=1e-7)
    np.testing.assert_allclose(np.diff(level), 1e-4 * (slope[1:] + slope[:-1]) / 2, atol=1e-3)


@pytest.mark.slow
def test_rope_that_stretches_below_the_housing_lowers_the_load_alone() -> None:
    stretch: Values = {"frequency_hz": 1.0, "above_housing": 0.0}
    sag_m = G / (2 * np.pi) ** 2
    hanging = predicted(RIG, {"rope_stretch": stretch}, (*START, 0.0, 0.0), TIME_S)
    known = predicted(RIG, {"rope_stretch": {**stretch, "sag_unknown": 0.0}}, (*START, 0.0, 0.0), TIME_S)

    assert hanging == pytest.approx(plain(rig=TwinRig(LENGTH_M + sag_m, POSITION_M)), abs=5e-3)
    assert known == pytest.approx(plain(), abs=5e-3)


def test_vibration_follows_an_ellipse() -> None:
    line: Values = {
        "frequency_hz": 3.0,
        "amplitude_g": (0.01, 0.02, 0.0),
        "lag_rad": (np.pi / 2, 0.0),
        "phase_rad": 0.4,
    }
    shaken = predicted(RIG, {"vibration": line}, START, TIME_S) - plain()
    angle = 2 * np.pi * 3.0 * TIME_S + 0.4

    np.testing.assert_allclose(shaken[:, 0], 0.01 * np.sin(angle), atol=1e-9)
    np.testing.assert_allclose(shaken[:, 1], -0.02 * np.cos(angle), atol=1e-9)


@pytest.mark.parametrize("rows", [Fraction(1), Fraction(5, 2), Fraction(3), Fraction(21, 5)])
def test_sample_hold_repeats_the_latest_reading(rows: Fraction) -> None:
    """Reading k is taken at k N rows and shown from the first row after that on."""
    count = 60
    samples = np.arange(count, dtype=np.float64)[:, None] * np.ones(3)
    held = EFFECTS["sample_hold"].sample_output_g({"rows": float(rows)}, samples)[:, 0]
    latest = [max(row for row in range(i + 1) if (row == 0 or row // rows > (row - 1) // rows)) for i in range(count)]

    assert held.tolist() == latest
    assert len(set(held)) == pytest.approx(count / float(rows), abs=1)


def test_vibration_goes_on_when_it_is_counted_from_a_later_sample() -> None:
    line: Values = {"frequency_hz": 3.7, "amplitude_g": (2e-3, 1e-3, 0.0), "lag_rad": (0.4, 0.0), "phase_rad": 1.0}
    later = EFFECTS["vibration"].shift_start(line, float(TIME_S[365]))
    shaken, shaken_later = (predicted(RIG, {"vibration": each}, START, TIME_S) - plain() for each in (line, later))
    assert np.abs(shaken[365:] - shaken_later[:-365]).max() < 1e-9
