"""Measured against simulated, before and after."""

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gateway.twin.reconcile.output.result import Curves, NamedEffect, Reconciliation
from gateway.twin.report.drawing import POINTS, curve, drawn, legend, panels
from gateway.twin.report.markup import Html, element, illustration, joined, missing, paragraph, section
from gateway.twin.report.models import BELIEVED, caution, final_name, only_name, same
from gateway.twin.report.stretch import acting_in, shows_gain, telling_stretch
from gateway.twin.report.style import ACTING, AFTER, BEFORE, INK, MEASURED
from gateway.twin.report.words import AXES, listed, plain, span

INSTANT = 0.01
"""An event shorter than this share of what is shown is drawn as a line."""


@dataclass(frozen=True, slots=True)
class View:
    """What a picture shows of a recording."""

    curves: Curves
    after: str
    """What the later model is called."""
    only: str
    """What the model is called where both simulate the same."""
    from_s: float
    to_s: float
    acting: tuple[NamedEffect, ...]
    box_s: tuple[float, float] | None
    """Where the next picture looks closer."""


def motion_part(result: Reconciliation) -> Html:
    """Over the whole recording, then the stretch that tells most, then the same on held-out data."""
    title, name = "Measured against simulated", "motion"
    if result.log is None:
        return section(title, missing("No simulation was made of this recording."), name=name)
    return section(
        title,
        paragraph(caution(result)) if caution(result) else "",
        _comparison(result, result.log, "log", _of_log(result)),
        element("h3", "On data that the model was not fitted to"),
        _held_out(result),
        name=name,
    )


def _comparison(result: Reconciliation, curves: Curves, name: str, what: str) -> Html:
    first, last = float(curves.time_s[0]), float(curves.time_s[-1])
    from_s, to_s = telling_stretch(result, curves)
    acting, names = acting_in(result, curves), (final_name(result), only_name(result))
    whole = _picture(f"{name}-whole", View(curves, *names, first, last, acting, (from_s, to_s)))
    zoom = _picture(f"{name}-zoom", View(curves, *names, from_s, to_s, acting, None))
    return joined(
        [
            illustration(
                whole, f"{what}, {span(first, last)}. The box marks the stretch shown below.", _marked(acting)
            ),
            illustration(zoom, f"{span(from_s, to_s)}: {_why(result, curves)}.", _marked(acting)),
        ]
    )


def _of_log(result: Reconciliation) -> str:
    split = result.held_out_is_last_third and result.held_out is not None
    return "The first two thirds of the recording" if split else "The recording"


def _held_out(result: Reconciliation) -> Html:
    if result.held_out is not None:
        what = (
            "last third of the recording, time counted anew" if result.held_out_is_last_third else "held-out recording"
        )
        return _comparison(
            result, result.held_out, "held-out", f"The {what} (only its initial motion and the like were fitted)"
        )
    if result.held_out_is_last_third:
        return missing(
            "No second recording was given: the last third of this one was held out, and it is part of the pictures above."
        )
    return missing("No held-out recording was given.")


def _why(result: Reconciliation, curves: Curves) -> str:
    acting = acting_in(result, curves)
    if acting:
        return f"where {plain(acting[0].name)} acted"
    return "where the model changed most" if shows_gain(result, curves) else "where most is left unexplained"


def _marked(acting: tuple[NamedEffect, ...]) -> str:
    return f" Marked in purple: when {listed([effect.name for effect in acting])} acted." if acting else ""


def _picture(name: str, view: View) -> Html:
    label = f"Specific force on three axes from {view.from_s:.0f} s to {view.to_s:.0f} s, measured and simulated"
    return drawn(name, label, 4.6, lambda figure: _draw(figure, view))


def _draw(figure: Figure, view: View) -> None:
    curves = view.curves
    models = [("before", curves.before_g, BEFORE), ("after", curves.after_g, AFTER)]
    if same(curves):
        models = [(view.only, curves.before_g, AFTER)]
    grid = panels(figure, len(models), share="row")
    shown = (curves.time_s >= view.from_s) & (curves.time_s <= view.to_s) & curves.used
    time_s, points = curves.time_s[shown], POINTS // len(models)
    for column, (title, simulated_g, color) in enumerate(models):
        for row, axis in enumerate(AXES):
            axes = grid[row, column]
            _mark(axes, view)
            curve(axes, time_s, curves.measured_g[shown, row], MEASURED, "measured", 1.5, points)
            curve(axes, time_s, simulated_g[shown, row], color, f"simulated, {title}", 0.9, points)
            axes.set_ylabel(f"{axis} (g)" if column == 0 else "")
        grid[0, column].set_title("" if len(models) == 1 else f"{title}: {BELIEVED if column == 0 else view.after}")
        grid[2, column].set_xlabel("time (s)")
        grid[2, column].set_xlim(view.from_s, view.to_s)
    legend(figure)


def _mark(axes: Axes, view: View) -> None:
    """When events acted, and where the next picture looks closer."""
    for effect in view.acting:
        assert effect.when_s is not None
        from_s, to_s = effect.when_s
        axes.axvline(from_s, color=ACTING, linewidth=0.9, linestyle="--")
        if to_s - from_s > INSTANT * (view.to_s - view.from_s):
            axes.axvline(to_s, color=ACTING, linewidth=0.9, linestyle="--")
            axes.axvspan(from_s, to_s, facecolor=ACTING, alpha=0.12, linewidth=0)
    if view.box_s is not None:
        axes.axvspan(*view.box_s, facecolor="none", edgecolor=INK, linewidth=0.8)
