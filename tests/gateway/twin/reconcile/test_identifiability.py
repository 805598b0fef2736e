"""Which effects can replace one of a fitted model, within what is possible and what parts have."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.observations import make_observations
from gateway.twin.reconcile.decision.identifiability import (
    FittedRecording,
    distance_within,
    indistinguishable_from,
    possible_changes,
)
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.reconcile.conftest import RATE_HZ, RIG

AT_PIVOT = replace(RIG, position_m=0.0)


def partners(model: EffectValues, name: str, others: tuple[str, ...], tilt_rad: float = 0.1) -> tuple[str, ...]:
    """Beside a remainder so large that whatever is within 0.1 rad of a contribution may be it."""
    simulator, time_s = Simulator(AT_PIVOT, sorted(model)), np.arange(0, 60, 1 / RATE_HZ)
    initial = np.array([tilt_rad, tilt_rad / 2, 0.0, 0.0, 0.0])
    force_g = simulator.predict(simulator.values(initial, model), time_s)
    observations = make_observations(time_s, force_g, None, np.array(RIG.noise_g))
    recording = FittedRecording(observations, {}, initial, heading_is_fitted=False, excess_chi2=1e6)
    return indistinguishable_from(AT_PIVOT, model, name, others, [recording])


def test_distance_is_to_the_nearest_point_inside_the_bounds() -> None:
    columns = np.array([[2.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    target = np.array([6.0, 1.0, 4.0])
    wide, narrow = np.full(2, 10.0), np.array([1.0, 10.0])

    assert distance_within(target, columns, -wide, wide) == pytest.approx(4.0)
    assert distance_within(target, columns, -narrow, narrow) == pytest.approx(np.hypot(4.0, 4.0))
    assert distance_within(target, columns, np.zeros(2), np.zeros(2)) == pytest.approx(np.linalg.norm(target))


def test_values_stay_within_their_bounds_and_what_parts_have() -> None:
    model: EffectValues = {"viscous_damping": {"damping_ratio": 0.01}, "axis_offset": {"offset_g": (0.5, 0.0, 0.0)}}
    simulator = Simulator(AT_PIVOT, sorted(model))
    lower, upper = possible_changes(simulator, model, RIG)
    ends = {spec.label: (a, b) for spec, a, b in zip(simulator.parameters, lower, upper, strict=True)}

    assert ends["viscous_damping.damping_ratio"] == pytest.approx((-0.01, 0.49))
    # 60 mg by data sheets; the prior density falls by 20 of evidence within √20 quarters of it.
    assert ends["axis_offset.offset_g[y]"] == pytest.approx((-0.1271, 0.1271), abs=1e-4)
    assert ends["axis_offset.offset_g[x]"] == pytest.approx((-0.6271, 0.0), abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("tilt_deg", "alternatives"), [(1.0, ("axis_offset", "cross_axis")), (9.7, ())])
def test_an_effect_that_needs_a_value_no_part_has_is_no_alternative(
    tilt_deg: float, alternatives: tuple[str, ...]
) -> None:
    """A small swing shows a tilt as an offset of its sine: 17 mg, which parts have, or 168 mg."""
    model: EffectValues = {"mount_misalignment": {"deg": (tilt_deg, 0.0)}}

    assert partners(model, "mount_misalignment", ("axis_offset", "cross_axis")) == alternatives


@pytest.mark.slow
def test_a_clock_is_no_alternative_of_a_loss_beside_a_length() -> None:
    """A clock and a length that are wrong together change the loss alone; to make all of it both would be far from true."""
    model: EffectValues = {"rope_length": {"relative_error": 0.001}, "viscous_damping": {"damping_ratio": 0.002}}

    assert partners(model, "viscous_damping", ("clock_drift",), tilt_rad=1.2) == ()
    assert partners(model, "rope_length", ("clock_drift",), tilt_rad=1.2) == ("clock_drift",)
