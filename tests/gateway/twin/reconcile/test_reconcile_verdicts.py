"""Each verdict from a situation that calls for it, and values that no part has."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.documents.format import format_number
from gateway.twin.model import Model
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.reconcile.output.serialisation import to_json, to_text
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.report.page import render_report
from tests.values import present


@pytest.mark.slow
def test_nothing_is_missing_even_under_slow_noise(model: Model, loaded: Callable[..., CheckedRecording]) -> None:
    found = reconcile(model, loaded({}, memory=0.8), loaded({}, "held_out", memory=0.8, seed=3))

    assert found.verdict == "none_missing"
    assert found.effects == ()


@pytest.mark.slow
def test_damping_is_named_with_its_value(model: Model, loaded: Callable[..., CheckedRecording]) -> None:
    hidden = {"viscous_damping": {"damping_ratio": 0.01}}
    found = reconcile(model, loaded(hidden), loaded(hidden, "held_out"))

    assert found.verdict == "named"
    assert [effect.name for effect in found.effects] == ["viscous_damping"]
    low, high = found.effects[0].parameters["damping_ratio"].ci95
    assert isinstance(low, float)
    assert isinstance(high, float)
    assert low < 0.01 < high
    assert present(found.comparison).gap.after_held_out == pytest.approx(1, abs=0.15)
    assert re.search(r"damping_ratio = 0\.0\d+ \(0\.0\d+ to 0\.0\d+\)$", to_text(found), re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize(("stated", "than"), [(0.003, "larger"), (0.02, "smaller")])
def test_an_effect_that_the_rig_states_with_a_wrong_value_is_named_with_the_true_one(
    model: Model, loaded: Callable[..., CheckedRecording], stated: float, than: str
) -> None:
    hidden = {"quadratic_drag": {"drag_per_m": 0.01}}
    believed = Model(model.rig, {"quadratic_drag": {"drag_per_m": stated}})
    found = reconcile(believed, loaded(hidden), loaded(hidden, "held_out"))

    assert found.verdict == "named"
    assert [effect.name for effect in found.effects] == ["quadratic_drag"]
    assert found.model["quadratic_drag"]["drag_per_m"] == pytest.approx(0.01, rel=0.05)
    assert "missing: quadratic_drag other than stated" in to_text(found)
    assert f"; {than} than stated: {stated:g} 1/m" in to_text(found)
    assert to_json(found, 0.0)["effects"][0]["parameters"]["drag_per_m"]["stated"] == stated
    page = render_report(found, title="t", software="s")
    assert f"states {format_number(stated)} 1/m" in page
    assert "lacks the true size of quadratic drag" in page


@pytest.mark.slow
def test_nothing_is_missing_where_the_rig_states_the_effect_rightly(
    model: Model, loaded: Callable[..., CheckedRecording]
) -> None:
    hidden = {"quadratic_drag": {"drag_per_m": 0.01}, "rope_length": {"relative_error": 0.02}}
    found = reconcile(Model(model.rig, hidden), loaded(hidden), loaded(hidden, "held_out"))

    assert found.verdict == "none_missing"


@pytest.mark.slow
def test_a_rope_that_is_longer_with_the_housing_in_proportion_is_in_the_group_of_the_clock(
    model: Model, loaded: Callable[..., CheckedRecording]
) -> None:
    hidden = {"rope_length": {"relative_error": 0.025}, "housing_position": {"error_m": 0.025 * model.rig.position_m}}
    found = reconcile(model, loaded(hidden), loaded(hidden, "held_out"))

    assert found.verdict == "one_of"
    assert set(found.candidates) == {"clock_drift", "rope_length", "housing_position"}
    assert "missing: one of clock_drift, housing_position with rope_length" in to_text(found)
    assert "clock drift or housing position with rope length" in render_report(found, title="t", software="s")
    assert to_json(found, 0.0)["candidate_sets"] == [["clock_drift"], ["housing_position", "rope_length"]]


@pytest.mark.slow
def test_what_the_data_cannot_separate_is_one_of_a_group_with_what_would_split_it(
    model: Model, loaded: Callable[..., CheckedRecording]
) -> None:
    hidden = {"housing_spin": {"rate_deg_s": 1.5}}
    found = reconcile(model, loaded(hidden), loaded(hidden, "held_out"))

    assert found.verdict == "one_of"
    assert set(found.candidates) == {"housing_spin", "slewing"}
    assert found.split_by


@pytest.mark.slow
def test_an_effect_that_nothing_explains_is_unmodelled(model: Model, loaded: Callable[..., CheckedRecording]) -> None:
    def driven(name: str) -> CheckedRecording:
        made = loaded({}, name)
        o, kept = present(made.observations), slice(len(made.time_s) // 2)
        time_s = o.time_s[kept]
        shaken = o.force_g[kept].copy()
        shaken[:, 0] += 0.01 * np.sin(2 * np.pi * 0.9 * time_s + 4 * np.sin(0.3 * time_s))
        return CheckedRecording(type(o)(time_s, shaken, None, o.noise_g, o.used[kept]), None, made.counts, time_s)

    found = reconcile(model, driven("log"), driven("held_out"))

    assert found.verdict == "unmodelled"
    assert found.effects == ()
    assert present(found.comparison).residual.peaks


def test_unusable_data_get_no_model(model: Model, loaded: Callable[..., CheckedRecording]) -> None:
    fault = CheckedRecording(None, "too short: 3 samples", {"read": 3}, np.arange(3.0))

    assert reconcile(model, fault, None).verdict == "data_unusable"


@pytest.mark.slow
def test_without_a_second_recording_the_last_third_is_held_out(
    model: Model, loaded: Callable[..., CheckedRecording]
) -> None:
    found = reconcile(model, loaded({"steady_wind": {"accel_m_s2": (0.3, 0.1)}}), None)

    assert present(found.comparison).held_out_is_last_third
    assert len(present(found.comparison).held_out.time_s) == 400
    assert [effect.name for effect in found.effects] == ["steady_wind"]


def test_evidence_contains_the_prior_of_the_values() -> None:
    force_g, values = np.zeros((300, 3)), {"axis_offset": {"offset_g": (0.136, 0.0, 0.0)}}
    log = Observations(np.arange(300) / 20, force_g, None, np.full(3, 1e-3), np.ones(300, dtype=bool))
    fit = Fit((), np.zeros(5), np.ones(5, dtype=bool), force_g, 900.0, np.eye(5), np.zeros((300, 3, 5)))
    usual = CandidateFit(values, fit, 1.0, 3, has_unexplained_residual=False)
    table = CandidateTable(log)

    assert table.bic(replace(usual, implausibility=25.0)) == table.bic(usual) + 25.0


@pytest.mark.slow
@pytest.mark.parametrize(("offset_g", "plausible"), [(0.03, True), (0.2, False)])
def test_offset_that_no_part_has_is_told_as_implausible(
    model: Model, loaded: Callable[..., CheckedRecording], offset_g: float, plausible: bool
) -> None:
    hidden = {"axis_offset": {"offset_g": (offset_g, 0.0, -offset_g / 4)}}
    found = reconcile(model, loaded(hidden), loaded(hidden, "held_out"))
    (effect,) = to_json(found, 0.0)["effects"]
    estimate = effect["parameters"]["offset_g"]

    assert effect["name"] == "axis_offset"
    assert (estimate["plausible"], estimate["limit"]) == (plausible, 0.06)
    assert ("implausible: beyond 0.06 g" in to_text(found)) is not plausible
