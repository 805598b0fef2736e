"""The equation of a remainder, from the search to a model that simulates."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from gateway.cli.main import main
from gateway.measurement.rig_file import read_rig
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.registry import BUILT_IN
from gateway.twin.effects.terms import registered_library
from gateway.twin.model import EffectValues, Model, model_of
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.equation import pairs_loss_with_gain, replaces_loss
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.reconcile.output.serialisation import format_model_toml, to_text
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.candidates import CandidateFit
from gateway.twin.reconcile.search.context import Budget
from gateway.twin.reconcile.search.validation import evaluate_on_validation
from tests.values import present

CREEP_G, SETTLE_S = np.array([0.008, -0.005, 0.006]), 7.0

pytestmark = pytest.mark.usefixtures("vocabulary")


@pytest.mark.slow
def test_play_that_hides_small_motion_is_predicted_on_another_recording(
    model: Model, record: Callable[..., Observations]
) -> None:
    play: EffectValues = {"backlash": {"gap_g": 0.0026, "share": (1.0, 0.99)}}
    with registered_library():
        validation = evaluate_on_validation(model.rig, play, record(play, "held_out"))
    assert validation.reduced_chi2 == pytest.approx(1, abs=0.1)


def creeping(recording: CheckedRecording) -> CheckedRecording:
    o = present(recording.observations)
    crept = o.force_g + np.outer(np.exp(-o.time_s / SETTLE_S), CREEP_G)
    return replace(recording, observations=replace(o, force_g=crept))


@pytest.mark.slow
def test_remainder_is_told_as_an_equation_and_its_model_simulates(
    model: Model, loaded: Callable[..., CheckedRecording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The search finds nothing.
    monkeypatch.setattr("gateway.twin.reconcile.reconcile.Budget", partial(Budget, max_fits=4))
    found = reconcile(model, creeping(loaded({})), creeping(loaded({}, "held_out")))

    assert found.verdict == "unmodelled"
    assert "verdict      unmodelled: reading = (+0.00" in to_text(found)
    law = present(found.law)
    (term,) = law.terms
    assert term.name == "creeping_offset"
    low, high = term.parameters["time_constant_s"].ci95
    assert isinstance(low, float)
    assert isinstance(high, float)
    assert low < SETTLE_S < high
    assert present(law.closed_test_percent) > 95
    assert present(found.comparison).gap.after_test == pytest.approx(1, abs=0.15)
    assert found.best_attempt == {}
    assert EFFECTS.sources == {BUILT_IN}

    rig = tmp_path / "model.toml"
    rig.write_text(format_model_toml(found))
    tau_s = tomllib.loads(rig.read_text())["model"]["creeping_offset"]["time_constant_s"]
    assert model_of(read_rig(rig)).effects["creeping_offset"]["time_constant_s"] == tau_s
    assert main(["simulate", str(rig), "--out", str(tmp_path / "again.csv"), "--duration", "5"]) == 0


@pytest.mark.parametrize(
    ("beside", "coefficient", "is_pair"),
    [("viscous_damping", 0.05, True), ("viscous_damping", -0.05, False), ("axis_offset", 0.05, False)],
)
def test_no_term_feeds_in_what_a_loss_beside_it_takes_out(beside: str, coefficient: float, is_pair: bool) -> None:
    """Viscous damping and a friction of the wrong sign: each has any size that the other allows."""
    found = candidate({beside: {}, "force_along_motion": {"coefficient": coefficient}})
    with registered_library():
        assert pairs_loss_with_gain(found, "force_along_motion") is is_pair


@pytest.mark.parametrize(("left", "is_replaced"), [(1e-9, True), (0.01, False)])
def test_no_law_takes_the_place_of_a_certain_loss(left: float, is_replaced: bool) -> None:
    """A named damping of zero beside a drag in the equation would contradict itself."""
    base, found = (candidate({"viscous_damping": {"damping_ratio": each}, "axis_offset": {}}) for each in (0.03, left))
    assert replaces_loss(found, base) is is_replaced


def candidate(values: EffectValues) -> CandidateFit:
    force_g = np.zeros((300, 3))
    fit = Fit((), np.zeros(5), np.ones(5, dtype=bool), force_g, 900.0, np.eye(5), np.zeros((300, 3, 5)))
    return CandidateFit(values, fit, 1.0, 2, has_unexplained_residual=False)
