"""What the pictures are made of: fewer points that look the same, the stretch that tells most, the rows of the gap."""

from collections.abc import Callable
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from gateway.twin.reconcile.output.result import Disagreement, Gap, Reconciliation, Step
from gateway.twin.report.drawing import drawn, thinned
from gateway.twin.report.gap import rows_of
from gateway.twin.report.remaining import banded
from gateway.twin.report.stretch import period_s, telling_stretch

Maker = Callable[..., Reconciliation]


def test_thinning_keeps_every_extreme_and_the_order_of_time() -> None:
    time_s = np.arange(10_000) / 100
    values = np.sin(time_s)
    values[5_432] = 9.0
    values[5_433] = -9.0
    thin_s, thin = thinned(time_s, values, 200)
    assert len(thin) <= 200
    assert (np.diff(thin_s) > 0).all()
    assert {9.0, -9.0} <= set(thin)
    assert np.array_equal(thinned(time_s[:150], values[:150], 200)[1], values[:150])


def test_bands_keep_the_level_of_white_noise_and_show_a_line() -> None:
    frequency_hz = np.linspace(0, 25, 12_001)
    power = np.ones_like(frequency_hz)
    power[np.searchsorted(frequency_hz, 12.0)] = 5_000.0
    bands_hz, mean = banded(frequency_hz, power)
    assert bands_hz[0] > 0
    assert np.median(mean) == pytest.approx(1.0)
    assert bands_hz[np.argmax(mean)] == pytest.approx(12.0, rel=0.03)


def test_an_event_is_the_telling_stretch(make: Maker) -> None:
    result = make("named")
    assert result.log is not None
    from_s, to_s = telling_stretch(result, result.log)
    assert from_s < 36.65 < to_s
    assert to_s - from_s == pytest.approx(3 * period_s(result), rel=1e-6)


def test_without_an_event_the_stretch_is_where_the_residual_shrank_most(make: Maker) -> None:
    result = make("named", effects=())
    assert result.log is not None
    assert telling_stretch(result, result.log)[0] > 25.0


def test_what_is_quicker_than_the_swing_is_shown_by_its_own_cycles(make: Maker) -> None:
    result = make("named", effects=(), disagreement=(Disagreement("z", 0.0, 60.0, (11.8, 12.2), 9.0),))
    assert result.log is not None
    from_s, to_s = telling_stretch(result, result.log)
    assert to_s - from_s == pytest.approx(12 / 12.2)


def test_a_stretch_stays_inside_a_short_recording(make: Maker) -> None:
    result = make("named")
    log = result.log
    assert log is not None
    short = replace(
        log,
        time_s=log.time_s[:500],
        measured_g=log.measured_g[:500],
        before_g=log.before_g[:500],
        after_g=log.after_g[:500],
        used=log.used[:500],
    )
    assert telling_stretch(result, short) == pytest.approx((0.0, 9.98))


def test_rows_go_from_the_believed_model_to_the_final_one() -> None:
    gap = Gap(100.0, 90.0, 1.0, 1.1, None)
    steps = (
        Step((), (), (), 100.0, 90.0, 0.0),
        Step(("impact",), (), ("axis_offset", "impact"), 5.0, None, 0.0),
        Step(("viscous_damping",), ("axis_offset",), ("impact", "viscous_damping"), 2.0, 2.1, 0.0),
    )
    rows = rows_of(gap, steps, "final model", frozenset({"impact", "viscous_damping"}))
    assert [row.label for row in rows] == [
        "model as believed",
        "+ axis offset\n+ impact",
        "+ viscous damping\n− axis offset",
        "final model",
    ]
    assert [row.log for row in rows] == [100.0, 5.0, 2.0, 1.0]
    assert [row.held_out for row in rows] == [90.0, None, 2.1, 1.1]


def two_ticks(figure: Figure) -> None:
    figure.subplots().set_yticks([0.0, 0.12345], ["$0$", "0.12345"])


def test_drawing_leaves_matplotlib_as_it_was_and_labels_exact() -> None:
    before = dict(mpl.rcParams)
    svg = drawn("x", 'a "b" <c>', 2.0, two_ticks)
    assert dict(mpl.rcParams) == before
    assert "0.12345" in svg
    assert "$0$" in svg
    assert 'aria-label="a &quot;b&quot; &lt;c&gt;"' in svg
    assert 'id="figure_1"' not in svg


def test_a_last_step_that_is_not_the_model_shown_is_followed_by_that_model() -> None:
    steps = (Step(("slewing",), (), ("slewing",), 1.0, None, 0.0),)
    rows = rows_of(Gap(100.0, 90.0, 1.0, 1.1, None), steps, "one of the group, as fitted", frozenset({"housing_spin"}))
    assert [(row.label, row.held_out) for row in rows[1:]] == [
        ("+ slewing", None),
        ("one of the group, as\nfitted", 1.1),
    ]
