"""Which multiple of the swing's frequency a line of the residual is at, by the frequency that the swing has, not the rig's."""

import numpy as np
import pytest

from gateway.twin.reconcile.output.result import Curves, Peak, Residual
from gateway.twin.reconcile.output.serialisation import to_json
from gateway.twin.reconcile.output.swing_lines import multiple_of_swing
from gateway.twin.reconcile.output.text import to_text
from tests.gateway.twin.report.conftest import made

SWING_HZ = 0.15
"""The rope of the rig would swing at 0.13 Hz."""


def _swinging(amplitude_g: float) -> Curves:
    time_s = np.arange(0, 120, 0.04)
    measured_g = np.random.default_rng(2).normal(size=(len(time_s), 3)) * 1e-3
    measured_g[:, 0] += amplitude_g * np.sin(2 * np.pi * SWING_HZ * time_s)
    return Curves(time_s, measured_g, measured_g, measured_g, np.ones(len(time_s), dtype=bool), np.full(3, 1e-3))


@pytest.mark.parametrize(
    ("hz", "multiple"), [(0.15, 1), (0.302, 2), (0.445, 3), (0.6, 4), (0.75, None), (0.335, None), (0.05, None)]
)
def test_a_line_is_at_a_multiple_of_what_the_load_swings_at(hz: float, multiple: int | None) -> None:
    assert multiple_of_swing(Peak(hz, "y", 1e-3), made("unmodelled", log=_swinging(0.05))) == multiple


def test_near_the_load_where_nothing_swings_across_the_rig_tells_the_frequency() -> None:
    result = made("unmodelled", log=_swinging(0.0))
    assert multiple_of_swing(Peak(2 / result.rig.small_swing_period_s, "z", 1e-3), result) == 2
    assert multiple_of_swing(Peak(0.3, "z", 1e-3), made("unmodelled", log=None)) is None


@pytest.mark.parametrize(("hz", "hints"), [(0.3, True), (0.15, False), (0.75, False)])
def test_the_strongest_line_at_a_multiple_is_a_hint(hz: float, hints: bool) -> None:
    peaks = (Peak(hz, "y", 2e-3), Peak(0.15, "x", 1e-3))
    result = made("unmodelled", log=_swinging(0.05), residual=Residual(False, 0.0, peaks, None))
    text = to_text(result)
    assert ("typical of a reading that is not linear" in text) is hints
    assert "1 mg at 0.15 Hz on x, the swing's frequency" in text
    assert ("2 mg at 0.3 Hz on y, twice the swing's frequency" in text) is hints
    assert to_json(result, 1.0)["residual"]["peaks"][1]["multiple_of_swing"] == 1
