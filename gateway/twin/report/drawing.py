"""Matplotlib figures as inline SVG: the same input gives the same bytes, and nothing global is left changed."""

import itertools
import re
from collections.abc import Callable
from io import StringIO
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.typing import RcKeyType
from numpy.typing import NDArray

from gateway.twin.report.markup import Html, escaped
from gateway.twin.report.style import FAINT, INK, LINE
from gateway.twin.report.words import decade

Array = NDArray[np.float64]
WIDTH_IN = 7.2
POINTS = 900
"""Of a curve across a figure: more than paper or a screen can show."""
STYLE: dict[RcKeyType, Any] = {
    "font.family": "sans-serif",
    # Measured with the first, which comes with matplotlib and is the widest: what a reader has instead fits.
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica", "sans-serif"],
    "font.size": 8.5,
    "svg.fonttype": "none",
    "text.parse_math": False,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.6,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "grid.color": LINE,
    "grid.linewidth": 0.4,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 0.9,
    "lines.solid_joinstyle": "round",
}
NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


def drawn(name: str, label: str, height_in: float, draw: Callable[[Figure], None], width_in: float = WIDTH_IN) -> Html:
    """SVG of what `draw` puts on a figure; `name` makes its ids its own, `label` is read to who cannot see it."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({**STYLE, "svg.hashsalt": name})
        figure = Figure(
            figsize=(width_in, height_in),
        )
        draw(figure)
        text = StringIO()
        figure.savefig(text, format="svg", metadata=NO_METADATA)
    return _inline(text.getvalue(), name, label)


def _inline(svg: str, name: str, label: str) -> Html:
    """Without prologue and fixed size, ids told apart, paths to a hundredth of a point (they are most of the file)."""
    body = svg[svg.index("<svg") :]
    opening, rest = body.split(">", 1)
    box = re.search(r'viewBox="[^"]*"', opening)
    assert box is not None
    rest = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", rest)
    rest = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), rest)
    head = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    return Html(f'{head} {box[0]} role="img" aria-label="{escaped(label)}">{rest}')


def thinned(time_s: Array, values: Array, points: int = POINTS) -> tuple[Array, Array]:
    """The least and the greatest of each stretch, in order of time: a curve (n,) that looks the same with fewer points."""
    stretches = points // 2
    if len(time_s) <= points:
        return time_s, values
    edges = np.linspace(0, len(time_s), stretches + 1).astype(int)
    kept = [
        first + np.unique([values[first:last].argmin(), values[first:last].argmax()])
        for first, last in itertools.pairwise(edges)
    ]
    places = np.concatenate(kept)
    return time_s[places], values[places]


def panels(
    figure: Figure,
    columns: int = 1,
    *,
    share: Literal["row", "all", "none"] = "none",
    apart: float = 0.12,
    above_in: float = 0.5,
) -> Any:
    """Axes (3, columns) over each other for x, y, z; margins in inches hold labels, titles and the legend above."""
    width, height = figure.get_size_inches()
    margins = {"left": 0.8 / width, "right": 1 - 0.08 / width, "bottom": 0.45 / height, "top": 1 - above_in / height}
    grid = {**margins, "hspace": apart, "wspace": 0.05}
    return figure.subplots(3, columns, sharex=True, sharey=share, squeeze=False, gridspec_kw=grid)


def legend(figure: Figure) -> None:
    """Above all, each name once though several axes may have it."""
    named = {
        label: handle for axes in figure.axes for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if named:
        figure.legend(named.values(), named.keys(), loc="upper right", ncols=3, borderaxespad=0.2)


def decades(axis: Axis) -> None:
    """A logarithmic scale with a number at each decade, in figures that need no formula typesetting."""
    axis.set_major_locator(LogLocator(numticks=6))
    axis.set_major_formatter(FuncFormatter(lambda value, _place: decade(value)))
    axis.set_minor_formatter(NullFormatter())


def curve(
    axes: Axes, time_s: Array, values: Array, color: str, label: str = "", width: float = 0.9, points: int = POINTS
) -> None:
    """A thinned line."""
    axes.plot(*thinned(time_s, values, points), color=color, label=label, linewidth=width)
