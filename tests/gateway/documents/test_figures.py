"""Helpers for figures: fewer points, round ticks, SVG as an element of a page."""

import numpy as np
import pytest

from gateway.documents.figures import decimate_curve, inline_svg, tick_step


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
