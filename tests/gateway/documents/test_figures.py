"""Helpers for figures: fewer points, round ticks, SVG as an element of a page."""

import numpy as np
import pytest

from gateway.documents.figures import decimate_band, decimate_curve, inline_svg, tick_step


def test_decimated_curve_keeps_every_extreme_and_the_order_of_time() -> None:
    time_s = np.arange(10_000) / 100
    values = np.sin(time_s)
    values[5_432] = 9.0
    values[5_433] = -9.0
    thin_s, thin = decimate_curve(time_s, values, 200)
    assert len(thin) <= 200
    assert (np.diff(thin_s) > 0).all()
    assert {9.0, -9.0} <= set(thin)
    assert np.array_equal(decimate_curve(time_s[:150], values[:150], 200)[1], values[:150])


def test_decimated_curve_keeps_gaps_and_the_extremes_beside_them() -> None:
    time_s, values = np.arange(10_000) / 100, np.zeros(10_000)
    values[5_000:5_003] = [9.0, np.nan, -9.0]
    thin = decimate_curve(time_s, values, 200)[1]
    assert np.isnan(thin).sum() == 1
    assert {9.0, -9.0} <= set(thin)
    assert np.isnan(decimate_curve(time_s, np.full(10_000, np.nan), 200)[1]).all()


def test_decimated_band_covers_every_value() -> None:
    time_s = np.arange(10_000) / 100
    low, high = np.sin(time_s), np.sin(time_s) + 1
    low[3_210], high[6_543] = -7.0, 8.0
    thin_s, thin_low, thin_high = decimate_band(time_s, low, high, 100)
    assert len(thin_s) == 100
    assert (thin_low.min(), thin_high.max()) == (-7.0, 8.0)
    assert np.array_equal(decimate_band(time_s[:50], low[:50], high[:50], 100)[1], low[:50])


@pytest.mark.parametrize(("half_range", "step"), [(4.5, 2.0), (1.0, 0.5), (0.34, 0.1), (70.0, 50.0), (0.0035, 0.002)])
def test_ticks_are_round_and_few(half_range: float, step: float) -> None:
    assert tick_step(half_range) == pytest.approx(step)
    assert half_range / step < 3.5


def test_inlined_svg_has_own_ids_an_escaped_label_and_short_paths() -> None:
    svg = (
        '<?xml version="1.0"?>\n<svg width="9pt" viewBox="0 0 9 9"><path id="p" d="M 1.23456 2"/><use href="#p"/></svg>'
    )
    text = inline_svg(svg, "gap", 'a "b" <c>')
    assert text.startswith("<svg ")
    assert 'viewBox="0 0 9 9" role="img" aria-label="a &quot;b&quot; &lt;c&gt;">' in text
    assert '<path id="gap-p" d="M 1.23 2"/><use href="#gap-p"/>' in text
    assert "width" not in text


def test_svg_without_a_view_box_is_refused() -> None:
    with pytest.raises(ValueError, match="viewBox"):
        inline_svg("<svg></svg>", "x", "")
