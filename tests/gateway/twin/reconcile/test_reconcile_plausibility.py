"""Values that no part has count against an effect, and the answer says so."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.model import Model
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.least_squares import Fit
from gateway.twin.reconcile.output.serialisation import to_json
from gateway.twin.reconcile.output.text import to_text
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable


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
