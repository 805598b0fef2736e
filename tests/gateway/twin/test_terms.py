"""Terms of a law: each vanishes at zero coefficients, has its unit, and acts as its closed form says."""

import numpy as np
import pytest

from gateway.twin.effect_loading import check_equations
from gateway.twin.effects import EFFECTS, BodyState, EvaluationContext, Values
from gateway.twin.effects.term import Term
from gateway.twin.effects.terms import TERMS, registered_library
from gateway.twin.model import EffectValues
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.swings import LENGTH_M, PERIOD_S, POSITION_M, RIG, SWING_RATE, G

LATER_S = 7.3
LOAD = BodyState((0.7, -0.4, -11.9), (0.5, 0.8, 0.1), SWING_RATE)
READING = (0.03, -0.05, 0.99)
ALONG_MOTION = (
    "force_by_velocity",
    "force_by_speed_squared",
    "force_along_motion",
)
CHANGING = [name for name in TERMS if TERMS[name].shape_parameters]


def typical(term: Term) -> Values:
    return {p.name: p.typical for p in term.parameters}


@pytest.mark.slow
@pytest.mark.parametrize("name", TERMS)
def test_term_is_linear_at_zero_and_vanishes_there(name: str) -> None:
    with registered_library():
        check_equations(TERMS[name], "the library")


@pytest.mark.parametrize("name", TERMS)
def test_a_term_feeds_energy_where_its_force_is_along_the_velocity(name: str) -> None:
    term, sizes = TERMS[name], typical(TERMS[name])
    opposite: Values = {each: value if isinstance(value, tuple) else -value for each, value in sizes.items()}

    assert term.feeds_energy(sizes) is (name in ALONG_MOTION)
    assert not term.feeds_energy(opposite)


def test_library_leaves_the_vocabulary_as_it_was() -> None:
    before = tuple(EFFECTS)
    with registered_library():
        assert set(TERMS) < set(EFFECTS)
        assert not set(EFFECTS.choose(is_scored=True)) & set(TERMS)
        assert not [name for name in TERMS if EFFECTS[name].is_guessed_from_residual]
    assert tuple(EFFECTS) == before


@pytest.mark.parametrize("name", [name for name, term in TERMS.items() if term.steady_frequency])
def test_periodic_term_is_integrated_in_sixteen_steps_a_period(name: str) -> None:
    values = {**typical(TERMS[name]), "frequency_hz": 2.5}
    assert TERMS[name].longest_step_s(values, LENGTH_M, G) == pytest.approx(1 / 40)


@pytest.mark.parametrize("name", CHANGING)
def test_term_counted_from_a_later_sample_is_the_same_term(name: str) -> None:
    term = TERMS[name]
    values = typical(term)
    shifted = term.shift_start(values, LATER_S)

    def acts(p: Values, time_s: float) -> list[float]:
        context = EvaluationContext(time_s, time_s, G, quadrature_g=(0.02, 0.03, 0.0))
        parts = [
            *term.force_m_s2(p, context, LOAD),
            *term.pivot_acceleration_m_s2(p, context),
            term.housing_rotation_rad(p, context),
            *term.reading_g(p, context, READING),
        ]
        return [float(each) for each in parts]

    assert acts(shifted, 1.9) == pytest.approx(acts(values, 1.9 + LATER_S), abs=1e-12)


def test_force_by_velocity_feeds_an_amplitude_that_grows_by_half_its_rate() -> None:
    rate = 0.02
    with registered_library():
        simulator = Simulator(RIG, ("force_by_velocity",))
        values = simulator.values([0.05, 0, 0, 0, 0], {"force_by_velocity": {"coefficient": rate}})
        time_s = np.linspace(0.0, 5 * PERIOD_S, 400)
        force_g = simulator.predict(values, time_s)
    assert force_g[-1, 0] / force_g[0, 0] == pytest.approx(np.exp(rate / 2 * time_s[-1]), rel=3e-3)


def test_backlash_follows_the_play_of_a_steady_swing() -> None:
    gap_g = 0.004
    time_s = np.linspace(0, 3 * PERIOD_S, 6000)
    with registered_library():
        simulator = Simulator(RIG, ("backlash",))
        start = [0.06, 0, 0, 0, 0]
        plain_g = simulator.predict(simulator.values(start, {}), time_s)[:, 0]
        values = simulator.values(start, {"backlash": {"gap_g": gap_g, "share": (1.0, 0.0)}})
        lagging_g = simulator.predict(values, time_s)[:, 0]
    follower = np.empty_like(plain_g)
    place = plain_g[0] - gap_g
    for i, driver in enumerate(plain_g):
        place = min(max(place, driver - gap_g), driver + gap_g)
        follower[i] = place
    assert np.abs(plain_g).max() == pytest.approx((1 - POSITION_M / LENGTH_M) * 0.06, rel=0.01)
    assert lagging_g == pytest.approx(follower, abs=0.01 * gap_g)


@pytest.mark.parametrize(("place_m", "acts_m_s2"), [((0.3, -0.4), (0.0, 0.0)), ((1.2, -1.6), (-0.045, 0.06))])
def test_force_with_dead_zone_begins_beyond_it_without_a_jump(
    place_m: tuple[float, float], acts_m_s2: tuple[float, float]
) -> None:
    values: Values = {"dead_zone_m": 0.5, "coefficient": -0.05}
    load = BodyState((*place_m, -11.9), (0.5, 0.8, 0.1), SWING_RATE)
    force = TERMS["force_with_dead_zone"].force_m_s2(values, EvaluationContext(0.0, 0.0, G), load)
    assert [float(each) for each in force] == pytest.approx([*acts_m_s2, 0.0], abs=1e-6)


def predict(effects: EffectValues, time_s: np.ndarray) -> np.ndarray:
    with registered_library():
        simulator = Simulator(RIG, tuple(effects))
        return simulator.predict(simulator.values([0.06, -0.03, 0.02, 0.07, 0], effects), time_s)


def test_steady_rotation_turns_the_readings_across_the_rope_evenly() -> None:
    rate_rad_s, time_s = 0.03, np.linspace(0, 2 * PERIOD_S, 200)
    plain_g = predict({}, time_s)
    turned_g = predict({"steady_rotation": {"coefficient": rate_rad_s}}, time_s)
    across = (plain_g[:, 0] + 1j * plain_g[:, 1]) * np.exp(-1j * rate_rad_s * time_s)
    assert turned_g == pytest.approx(np.column_stack([across.real, across.imag, plain_g[:, 2]]), abs=1e-12)


def test_delayed_reading_is_the_reading_of_an_earlier_time() -> None:
    delay_s = 0.02
    time_s = np.arange(0, 2 * PERIOD_S, delay_s)
    late_g = predict({"delayed_reading": {"delay_s": (delay_s, 0.0)}}, time_s)[1:]
    plain_g = predict({}, time_s)
    second_order_g = (SWING_RATE * delay_s) ** 2 * 0.06
    assert late_g == pytest.approx(np.column_stack([plain_g[:-1, 0], plain_g[1:, 1:]]), abs=second_order_g)
    assert np.abs(plain_g[1:, 0] - plain_g[:-1, 0]).max() > 20 * second_order_g


def test_law_of_a_term_is_told_with_sign_unit_and_meaning() -> None:
    term = TERMS["force_by_velocity"]
    assert term.law({"coefficient": 0.0042}) == "+0.0042 1/s v"
    assert term.in_words({"coefficient": 0.0042}) == "energy is fed in"
    assert term.in_words({"coefficient": -0.0042}) == "energy is taken out"
    sway = TERMS["pivot_sway"]
    values: Values = {"frequency_hz": 0.41, "sine": (0.03, 0.0), "cosine": (0.0, 0.04)}
    assert sway.law(values) == "0.04 m/s² sin(2π f t + φ), horizontal, f = 0.41 Hz"
