"""Multiple shooting, event windows and lost samples: planted values come back."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.changepoints.changepoint import locate_changepoint
from gateway.twin.reconcile.changepoints.changepoint_scan import scan_for_changepoints
from gateway.twin.reconcile.data.observations import Observations, slice_samples
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.validation import evaluate_on_validation
from gateway.twin.reconcile.timing.timing_jitter import estimate_time_warp, viterbi_loss_count
from tests.values import present


def setting(rig: TwinRig, observations: Observations) -> FitContext:
    return FitContext(rig, {}, observations, lambda: None)


def test_a_wrong_rope_is_found_though_the_swing_runs_out_of_step(
    rig: TwinRig, record: Callable[..., Observations]
) -> None:
    fit = setting(rig, record({"rope_length": {"relative_error": 0.25}})).fit({"rope_length": {}}, iterations=15)

    assert fit.values[5] == pytest.approx(0.25, abs=1e-3)
    assert fit.chi2 / (3 * 1200) == pytest.approx(1, abs=0.1)


def test_the_start_and_its_uncertainty_are_those_of_the_recording(
    rig: TwinRig, record: Callable[..., Observations]
) -> None:
    fit = setting(rig, record({})).fit({})
    sigma = np.sqrt(np.diag(fit.covariance()))

    assert np.all(np.abs(fit.values[:4] - (0.10, 0.04, -0.02, 0.05)) < 5 * sigma)
    assert np.all(sigma < 1e-3)


def test_the_window_of_a_blow_is_where_it_struck(rig: TwinRig, record: Callable[..., Observations]) -> None:
    observations = record({"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 27.3}})
    context = setting(rig, observations)
    base = context.fit({})
    simulator = context.simulator(())
    jacobian = simulator.linearise(base.values, observations.time_s).jacobian / observations.noise_g[:, None]
    first = scan_for_changepoints(
        observations.time_s, observations.residual_sigma(base.force_g), jacobian[..., :4], observations.used
    )[0]

    assert first.from_s == pytest.approx(27.3, abs=1.0)
    assert first.to_s == first.from_s


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "from_s", "to_s", "length"),
    [
        ({"wind_gust": {"accel_m_s2": (0.2, 0.1), "start_s": 25.0, "duration_s": 6.0}}, 25.0, 31.0, False),
        ({"hoisting": {"speed_m_s": -0.1, "start_s": 25.0, "duration_s": 6.0}}, 25.0, 31.0, True),
        ({"load_change": {"length_change_m": -0.5, "start_s": 28.0}}, 28.0, 28.0, True),
    ],
)
def test_where_the_motions_before_and_after_an_event_part(
    rig: TwinRig, record: Callable[..., Observations], effect: EffectValues, from_s: float, to_s: float, length: bool
) -> None:
    found = locate_changepoint(setting(rig, record(effect)), {}, length=length)

    assert found is not None
    assert found.from_s == pytest.approx(from_s, abs=1.1)
    assert found.to_s == pytest.approx(to_s, abs=1.1)
    assert found.remaining_chi2 < 1.1 * 3 * 1200


def test_nothing_parts_where_nothing_happens_or_the_model_is_wrong_from_the_start(
    rig: TwinRig, record: Callable[..., Observations]
) -> None:
    assert locate_changepoint(setting(rig, record({})), {}, length=True) is None
    assert locate_changepoint(setting(rig, record({"rope_length": {"relative_error": 0.05}})), {}, length=True) is None


@pytest.mark.slow
def test_lost_samples_are_counted_without_a_trace_in_the_times(
    rig: TwinRig, record: Callable[..., Observations]
) -> None:
    observations = record({})
    rng = np.random.default_rng(2)
    kept = np.flatnonzero(rng.random(1200) >= 0.03)
    even_s = observations.time_s[: len(kept)]
    lossy = type(observations)(even_s, observations.force_g[kept], None, observations.noise_g, observations.used[kept])
    simulator = setting(rig, lossy).simulator(())
    start = setting(rig, lossy).fit({"clock_drift": {}}).values[:5]
    walk = viterbi_loss_count(simulator, present(estimate_time_warp(simulator, start, lossy, 0.03)), lossy)

    assert walk.fraction == pytest.approx(1 - len(kept) / 1200, abs=0.004)
    assert walk.reduced < 1.3


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect",
    [
        {"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 15.0}},
        {"impact": {"delta_v_m_s": (0.3, -0.2), "start_s": 50.0}},
        {"hoisting": {"speed_m_s": -0.1, "start_s": 12.0, "duration_s": 8.0}},
    ],
    ids=["a blow before it", "a blow in it", "a shorter rope since"],
)
def test_a_later_piece_of_a_recording_knows_when_events_were(
    rig: TwinRig, record: Callable[..., Observations], effect: EffectValues
) -> None:
    whole = record(effect)
    last_third = slice_samples(whole, 800, 1200)

    assert evaluate_on_validation(rig, effect, last_third).reduced_chi2 == pytest.approx(1, abs=0.1)
    assert evaluate_on_validation(rig, effect, replace(last_third, offset_s=0.0)).reduced_chi2 > 2
