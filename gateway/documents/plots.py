"""Matplotlib plots as inline SVG: the same input gives the same bytes, and global settings stay unchanged."""

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

from gateway.documents.figures import CURVE_POINTS, FAINT, INK, LINE, decimate_curve, inline_svg
from gateway.documents.format import format_decade

Array = NDArray[np.float64]
WIDTH_IN = 7.2
"""Basis: the width of A4 less margins of 14 mm."""
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
"""Style of all figures. Basis: a choice of taste; text is as large as that around it."""
NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


def render_svg(
    name: str, label: str, height_in: float, draw: Callable[[Figure], None], width_in: float = WIDTH_IN
) -> str:
    """Return the SVG of what `draw` puts on a figure; `name` keeps its ids apart, `label` is the text for screen readers."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({**STYLE, "svg.hashsalt": name})
        figure = Figure(figsize=(width_in, height_in))
        draw(figure)
        text = StringIO()
        figure.savefig(text, format="svg", metadata=NO_METADATA)
    return inline_svg(text.getvalue(), name, label)


def add_panels(
    figure: Figure,
    columns: int = 1,
    *,
    share: Literal["row", "all", "none"] = "none",
    gap: float = 0.12,
    top_margin_in: float = 0.5,
) -> Any:
    """Return axes (3, columns) for x, y, z; margins in inches hold labels, titles and the legend above."""
    width, height = figure.get_size_inches()
    margins = {
        "left": 0.8 / width,
        "right": 1 - 0.08 / width,
        "bottom": 0.45 / height,
        "top": 1 - top_margin_in / height,
    }
    grid = {**margins, "hspace": gap, "wspace": 0.05}
    return figure.subplots(3, columns, sharex=True, sharey=share, squeeze=False, gridspec_kw=grid)


def add_legend(figure: Figure) -> None:
    """Add a legend above all axes, with each name once."""
    named = {
        label: handle for axes in figure.axes for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if named:
        figure.legend(named.values(), named.keys(), loc="upper right", ncols=3, borderaxespad=0.2)


def label_decades(axis: Axis) -> None:
    """Label a logarithmic scale at each decade, with digits that need no formula typesetting."""
    axis.set_major_locator(LogLocator(numticks=6))
    axis.set_major_formatter(FuncFormatter(lambda value, _place: format_decade(value)))
    axis.set_minor_formatter(NullFormatter())


def plot_curve(
    axes: Axes,
    time_s: Array,
    values: Array,
    color: str,
    label: str = "",
    width: float = 0.9,
    points: int = CURVE_POINTS,
) -> None:
    """Plot a decimated curve."""
    axes.plot(*decimate_curve(time_s, values, points), color=color, label=label, linewidth=width)
