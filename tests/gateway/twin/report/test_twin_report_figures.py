"""Contents of the figures: decimated spectra, the most informative window, marked events, the rows of the gap."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from gateway.documents.plots import render_svg
from gateway.twin.reconcile.output.result import Curves, Disagreement, Gap, Reconciliation, Step
from gateway.twin.report.gap import gap_rows
from gateway.twin.report.motion import decimate_spectrum, effects_acting_in, most_informative_window
from tests.gateway.twin.report.conftest import Maker
from tests.gateway.twin.report.report_page import html_of
from tests.values import present


def test_decimated_spectrum_keeps_the_level_of_white_noise_and_a_line() -> None:
    frequency_hz = np.linspace(0, 25, 12_001)
    power = np.ones_like(frequency_hz)
    power[np.searchsorted(frequency_hz, 12.0)] = 5_000.0
    bands_hz, mean = decimate_spectrum(frequency_hz[1:], power[1:])
    assert np.median(mean) == pytest.approx(1.0)
    assert bands_hz[np.argmax(mean)] == pytest.approx(12.0, rel=0.03)


def window_of_log(result: Reconciliation) -> tuple[float, float]:
    compared = present(result.comparison)
    return most_informative_window(result, compared, compared.log)


def first_part(result: Reconciliation, count: int) -> Curves:
    log = present(result.comparison).log
    arrays = {name: getattr(log, name)[:count] for name in ("time_s", "measured_g", "before_g", "after_g", "used")}
    return replace(log, **arrays)


def test_most_informative_window_shows_the_event(make: Maker) -> None:
    result = make("named")
    from_s, to_s = window_of_log(result)
    assert from_s < 36.65 < to_s
    assert to_s - from_s == pytest.approx(3 * result.rig.small_swing_period_s, rel=1e-6)


def test_window_without_an_event_shows_the_largest_improvement(make: Maker) -> None:
    assert window_of_log(make("named", effects=()))[0] > 25.0


def test_window_of_a_fast_oscillation_shows_its_cycles(make: Maker) -> None:
    result = make("named", effects=(), disagreement=(Disagreement("z", 0.0, 60.0, (11.8, 12.2), 9.0),))
    from_s, to_s = window_of_log(result)
    assert to_s - from_s == pytest.approx(12 / 12.2)


def test_window_stays_inside_a_short_recording(make: Maker) -> None:
    result = make("named")
    assert window_of_log(make("named", log=first_part(result, 500))) == pytest.approx((0.0, 9.98))


def test_no_more_than_the_whole_gap_is_closed() -> None:
    assert Gap.closed_percent(11.0, 1.5) == pytest.approx(95.0)
    assert Gap.closed_percent(14.0, 0.36) == 100.0
    assert Gap.closed_percent(1.0, 0.9) is None


def test_gap_rows_go_from_the_nominal_to_the_final_model() -> None:
    gap = Gap(100.0, 90.0, 90.0, 1.0, 1.1, 1.1, (80.0, 100.0))
    steps = (
        Step((), (), (), 100.0, 90.0, 0.0),
        Step(("impact",), (), ("axis_offset", "impact"), 5.0, 5.1, 0.0),
        Step(("viscous_damping",), ("axis_offset",), ("impact", "viscous_damping"), 2.0, 2.1, 0.0),
    )
    rows = gap_rows(gap, steps, "final model", frozenset({"impact", "viscous_damping"}))
    assert [row.label for row in rows] == [
        "nominal model",
        "+ axis offset\n+ impact",
        "+ viscous damping\n− axis offset",
        "final model",
    ]
    assert [row.log for row in rows] == [100.0, 5.0, 2.0, 1.0]
    assert [row.held_out for row in rows] == [90.0, 5.1, 2.1, 1.1]


def two_ticks(figure: Figure) -> None:
    figure.subplots().set_yticks([0.0, 0.12345], ["$0$", "0.12345"])


def test_rendering_keeps_global_settings_and_exact_labels() -> None:
    before = dict(mpl.rcParams)
    svg = render_svg("x", 'a "b" <c>', 2.0, two_ticks)
    assert dict(mpl.rcParams) == before
    assert "0.12345" in svg
    assert "$0$" in svg
    assert 'aria-label="a &quot;b&quot; &lt;c&gt;"' in svg
    assert 'id="figure_1"' not in svg


def test_gap_rows_end_with_the_model_shown() -> None:
    steps = (Step(("slewing",), (), ("slewing",), 1.0, 1.2, 0.0),)
    rows = gap_rows(
        Gap(100.0, 90.0, 90.0, 1.0, 1.1, 1.1, (80.0, 100.0)),
        steps,
        "one of the group, as fitted",
        frozenset({"housing_spin"}),
    )
    assert [(row.label, row.held_out) for row in rows[1:]] == [
        ("+ slewing", 1.2),
        ("one of the group, as\nfitted", 1.1),
    ]


def later_part(result: Reconciliation, offset_s: float) -> Curves:
    """The last 20 s of the log, as the held-out part of a lone recording."""
    log = present(result.comparison).log
    last = log.time_s > 40.0
    arrays = {name: getattr(log, name)[last] for name in ("measured_g", "before_g", "after_g", "used")}
    return replace(log, time_s=log.time_s[last] - log.time_s[last][0], offset_s=offset_s, **arrays)


@pytest.mark.parametrize(
    ("when_s", "in_first", "in_later"),
    [
        ((36.65, 36.65), True, False),
        ((30.0, 35.0), True, False),
        ((30.0, 45.0), True, True),
        ((50.0, 55.0), False, True),
        ((70.0, 75.0), False, False),
    ],
)
def test_event_is_marked_only_where_it_acted(
    make: Maker, when_s: tuple[float, float], in_first: bool, in_later: bool
) -> None:
    result = make("named")
    event = replace(result.effects[1], when_s=when_s)
    result = replace(result, effects=(event,))
    assert (event in effects_acting_in(result, first_part(result, 2000))) is in_first
    assert (event in effects_acting_in(result, later_part(result, 40.0))) is in_later


@pytest.mark.slow
def test_figures_of_a_later_part_count_time_from_the_start_of_the_recording(make: Maker) -> None:
    later = later_part(make("named"), 40.02)
    html = html_of("motion", make("named", held_out_is_last_third=True, held_out=later))
    fitted, _, whole, zoom = html.split("<figure>")[1:]
    assert "The last third of the recording" in whole
    assert "40.0 s to 60.0 s" in whole
    assert "Purple" not in whole + zoom
    assert "Purple: when impact acted." in fitted
    assert ">50.0<" in whole
    assert ">10.0<" not in whole
