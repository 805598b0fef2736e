"""The timeline: angle with its interval, pivot, hoist, lean, and the states of alerts, condition, gateway and clock.

The time axes of all figures have ticks at round times of UTC, and the local time above them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FixedLocator, FuncFormatter

from gateway.documents.figures import AFTER, ALARM, BEFORE, EVENT, FAINT, INK, LINE, MEASURED, Figure, decimate_band
from gateway.documents.plots import WIDTH_IN, plot_curve, render_svg
from gateway.incident.course import TRUSTED_TEXT, Course
from gateway.incident.facts import IncidentFacts
from gateway.incident.incident_selection import AlertIncident
from gateway.incident.sample_gaps import TimeGap, broken_at
from gateway.incident.setting_changes import setting_text
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.pipeline.alert_rules import SWING
from gateway.recording.reading.interval import zoned

STEPS_S = (0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 43200, 86400)
"""Distances of ticks. Definition: round steps of seconds, minutes and hours."""
MAX_TICKS = 8
"""Basis: a choice; labels of the time do not touch."""
PRINTED_NS = 100_000_000
"""Times of a report have tenths of a second. Basis: a choice; the motion has ten values a second."""
EDGE_SHARE = 0.03
"""Share of the axis before its end without a tick. Basis: half a label."""
HEIGHT_IN = 8.4
"""Basis: a choice; the figure and its caption fill one page of A4."""
PANEL_HEIGHTS = (3.4, 1.5, 1.2, 1.2, 2.6)
"""Relative heights: angle, pivot, hoist, lean, states. Basis: a choice of taste; the angle is what is asked for, and states need
a line each."""
COLOURS = {
    "trip": ALARM,
    "warn": "#e69f00",
    "normal": LINE,
    "driven": "#56b4e9",
    "hoisting": "#009e73",
    "wind": "#cc79a7",
    "swinging": LINE,
    "static": LINE,
    "quasi_static": LINE,
    "rest": LINE,
    "free": LINE,
    "disturbed": BEFORE,
    "running": LINE,
    "synchronised": LINE,
    TRUSTED_TEXT: LINE,
}
"""Other states, such as unknown, are white with a frame. Okabe and Ito 2008."""
DARK = frozenset({"trip", "disturbed"})
CHARACTER_SHARE = 0.0105
"""Width of a character as a share of the panel's width. Basis: the width of the font of the labels at the width of the figure."""
LIMIT_KEYS = {"warn": "alerts.warn_deg", "trip": "alerts.trip_deg", "clears below": "alerts.clear_deg"}
"""The keys of the limits that are drawn."""
NOT_TRUSTED = "not trusted"
HALF_HEIGHT = 0.36
"""Half the height of a bar of a state. Basis: a choice of taste; rows are one apart."""
LABEL_BOX = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.6}
"""Box around a label. Basis: a choice of taste; the curve shows through."""
MIN_REACH_DEG, MIN_REACH_M_S = 0.5, 0.1
"""Reach of a scale at least. Basis: a wide interval of a moment does not stretch it."""


@dataclass(frozen=True, slots=True)
class ReportClock:
    """Converts times of a course into text, in UTC, or with `is_local` in the time zone of the computer that makes the report."""

    course: Course

    def moment(self, time_s: float, *, is_local: bool = False) -> datetime:
        """Return date and time, rounded to what is printed."""
        utc_ns = (self.course.utc_ns(time_s) + PRINTED_NS // 2) // PRINTED_NS * PRINTED_NS
        return zoned(utc_ns, is_local=is_local)

    def time(self, time_s: float, *, is_local: bool = False) -> str:
        """Return `10:31:05.2`."""
        moment = self.moment(time_s, is_local=is_local)
        return f"{moment:%H:%M:%S}.{moment.microsecond * 1000 // PRINTED_NS}"

    def date(self, time_s: float, *, is_local: bool = False) -> str:
        """Return `2026-11-22`."""
        return f"{self.moment(time_s, is_local=is_local):%Y-%m-%d}"

    def both(self, time_s: float) -> str:
        """Return `2026-11-22 10:31:05.2 UTC (12:31:05.2 EET)`."""
        local = self.moment(time_s, is_local=True)
        text = f"{self.date(time_s)} {self.time(time_s)} UTC"
        if local.utcoffset() == self.moment(time_s).utcoffset():
            return text
        day = "" if self.date(time_s) == self.date(time_s, is_local=True) else f"{self.date(time_s, is_local=True)} "
        return f"{text} ({day}{self.time(time_s, is_local=True)} {self.zone(time_s)})"

    def zone(self, time_s: float) -> str:
        """Return the name of the local time zone."""
        return self.moment(time_s, is_local=True).tzname() or "local"


def tick_times(clock: ReportClock, begin_s: float, end_s: float) -> list[float]:
    """Return times of the course at which UTC is a round time, at most MAX_TICKS."""
    step_s = next((step for step in STEPS_S if (end_s - begin_s) / step <= MAX_TICKS), STEPS_S[-1])
    step_ns, begin_ns = round(step_s * 1e9), clock.course.utc_ns(begin_s)
    first_s = begin_s + (-begin_ns % step_ns) / 1e9
    last_s = end_s - EDGE_SHARE * (end_s - begin_s)
    return [first_s + number * step_s for number in range(math.floor((last_s - first_s) / step_s) + 1)]


def label_times(axes: Axes, clock: ReportClock, begin_s: float, end_s: float) -> None:
    """Put UTC below the axes."""
    axes.set_xlim(begin_s, end_s)
    axes.xaxis.set_major_locator(FixedLocator(tick_times(clock, begin_s, end_s)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda time_s, _place: tick_label(clock, time_s, end_s - begin_s)))
    axes.set_xlabel(f"UTC, {clock.date((begin_s + end_s) / 2)}")


def label_local_times(axes: Axes, clock: ReportClock, begin_s: float, end_s: float) -> None:
    """Put the local time above the axes where it differs from UTC."""
    if clock.moment(begin_s).utcoffset() == clock.moment(begin_s, is_local=True).utcoffset():
        return
    above = axes.secondary_xaxis("top")
    above.xaxis.set_major_locator(FixedLocator(tick_times(clock, begin_s, end_s)))
    above.xaxis.set_major_formatter(
        FuncFormatter(lambda time_s, _place: tick_label(clock, time_s, end_s - begin_s, is_local=True))
    )
    above.set_xlabel(f"local time, {clock.zone(begin_s)}, {clock.date((begin_s + end_s) / 2, is_local=True)}")


def tick_label(clock: ReportClock, time_s: float, span_s: float, *, is_local: bool = False) -> str:
    """Return the time of a tick on an axis of `span_s`."""
    if span_s < MAX_TICKS:
        return clock.time(time_s, is_local=is_local)
    return f"{clock.moment(time_s, is_local=is_local):%H:%M:%S}"


def timeline_figure(course: Course, incident: AlertIncident | None, facts: IncidentFacts) -> Figure:
    """Return the figure."""
    clock = ReportClock(course)

    def draw(canvas: Canvas) -> None:
        margins = {"left": 0.15, "right": 0.985, "bottom": 0.06, "top": 0.94, "hspace": 0.12}
        panels = canvas.subplots(
            len(PANEL_HEIGHTS), 1, sharex=True, gridspec_kw={"height_ratios": PANEL_HEIGHTS, **margins}
        )
        _draw_angle(panels[0], course, incident, facts)
        _draw_motion(panels[1:4], course)
        _draw_states(panels[4], course)
        for axes in panels:
            mark_hidden(axes, course)
            _mark_incident(axes, facts)
        label_times(panels[-1], clock, course.begin_s, course.end_s)
        label_local_times(panels[0], clock, course.begin_s, course.end_s)
        canvas.align_ylabels(panels[:4])

    label = "Timeline of angle, pivot acceleration, hoisting, lean and states; the tables and sentences state the same"
    return Figure(
        svg=render_svg("timeline", label, HEIGHT_IN, draw, WIDTH_IN),
        caption="Angle between rope and vertical, limits dashed; acceleration of the rope's upper end along x and y of the "
        "housing; rate of the rope's length, lowering positive; lean of the rope; states. Shaded: intervals of 95 %. Vertical "
        "lines: begin and end of the incident (solid), largest angle (dotted). All of it as the gateway estimated it live."
        f"{hidden_caption(course, course.begin_s, course.end_s)}",
    )


def hidden_caption(course: Course, begin_s: float, end_s: float) -> str:
    """Return why some times between two are hatched; empty: none are."""
    found = []
    for what, gaps in (("no samples", course.samples.gaps), ("the sensor off the rope", course.suspensions)):
        if causes := ", ".join(dict.fromkeys(each.cause for each in gaps if each.within_s(begin_s, end_s))):
            found.append(f"{what} ({causes})")
    return f" Hatched: {'; '.join(found)}." if found else ""


def _draw_angle(axes: Axes, course: Course, incident: AlertIncident | None, facts: IncidentFacts) -> None:
    motion = course.motion
    _draw_band(axes, course.hidden, motion.time_s, motion.angle_deg, motion.u_deg)
    axes.set_ylabel("angle, °")
    limit_deg = 0.0 if incident is None else incident.highest.limit_deg or 0.0
    levels = {} if incident is None or incident.rule != SWING.name else levels_in_force(course, incident)
    limits_deg = [level_deg for spans in levels.values() for _, _, level_deg in spans]
    axes.set_ylim(0, max(MIN_REACH_DEG, 1.15 * max(limit_deg, *limits_deg, _largest(motion.angle_deg))))
    if incident is None or incident.rule != SWING.name:
        return
    for name, spans in levels.items():
        colour = ALARM if name == "trip" else FAINT
        for from_s, to_s, level_deg in spans:
            axes.plot([from_s, to_s], [level_deg, level_deg], color=colour, linewidth=0.8, linestyle=(0, (5, 3)))
            axes.annotate(
                f"{name} {setting_text('deg', level_deg)}",
                (to_s, level_deg),
                ha="right",
                va="bottom",
                fontsize=7.5,
                color=colour,
                bbox=LABEL_BOX,
            )
    if facts.peak is not None:
        axes.plot(facts.peak.time_s, facts.peak.angle_deg, "o", color=EVENT, markersize=4)
        axes.annotate(
            f"{facts.peak.angle_deg:.2f}°",
            (facts.peak.time_s, facts.peak.angle_deg),
            xytext=(5, 3),
            textcoords="offset points",
            color=EVENT,
        )


def levels_in_force(course: Course, incident: AlertIncident) -> dict[str, list[tuple[float, float, float]]]:
    """Return (begin, end, limit) of each level of an incident, by the configurations in force, or else by the alert itself."""
    own: dict[str, float | None] = {each.level: each.limit_deg for each in incident.changes if each.level in LIMIT_KEYS}
    own["clears below"] = incident.highest.clear_deg
    levels: dict[str, list[tuple[float, float, float]]] = {}
    for name, own_deg in own.items():
        spans = levels.setdefault(name, [])
        for time_s, limit_deg in [(each.time_s, each.number(LIMIT_KEYS[name])) for each in course.configurations] or [
            (course.begin_s, own_deg)
        ]:
            from_s = max(time_s, course.begin_s)
            if limit_deg is None:
                continue
            if spans and spans[-1][2] == limit_deg:
                spans[-1] = (spans[-1][0], course.end_s, limit_deg)
                continue
            if spans:
                spans[-1] = (spans[-1][0], from_s, spans[-1][2])
            spans.append((from_s, course.end_s, limit_deg))
    return levels


def _largest(values: Array) -> float:
    return float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0


def _draw_motion(panels: Sequence[Axes], course: Course) -> None:
    motion, gaps = course.motion, course.hidden
    pivot, hoist, lean = panels
    for column, (name, colour) in enumerate((("x", AFTER), ("y", BEFORE))):
        time_s, pivot_m_s2 = broken_at(gaps, motion.time_s, motion.pivot_m_s2[:, column])
        plot_curve(pivot, time_s, pivot_m_s2, colour, name)
    pivot.set_ylabel("pivot, m/s²")
    pivot.legend(loc="upper right", ncols=2, handlelength=1.2)
    _draw_band(hoist, gaps, motion.time_s, motion.hoist_m_s, motion.hoist_u_m_s)
    hoist.set_ylabel("hoist, m/s")
    reach_m_s = max(MIN_REACH_M_S, 1.3 * _largest(motion.hoist_m_s))
    hoist.set_ylim(-reach_m_s, reach_m_s)
    for axes in (pivot, hoist):
        axes.axhline(0, color=FAINT, linewidth=0.5)
    _draw_band(lean, gaps, motion.time_s, motion.lean_deg, motion.lean_u_deg)
    lean.set_ylabel("lean, °")
    lean.set_ylim(bottom=0)


def _draw_band(axes: Axes, gaps: Sequence[TimeGap], time_s: Array, values: Array, u_values: Array) -> None:
    """Draw a curve with its interval of 95 %, and nothing in the gaps."""
    time_s, values, u_values = broken_at(gaps, time_s, values, u_values)
    half = NORMAL_975 * u_values
    axes.fill_between(*decimate_band(time_s, values - half, values + half), color=AFTER, alpha=0.22, linewidth=0)
    plot_curve(axes, time_s, values, AFTER)


def _draw_states(axes: Axes, course: Course) -> None:
    known = tuple(state if state == TRUSTED_TEXT else NOT_TRUSTED for state in course.trusted.state)
    reading = replace(course.trusted, state=known)
    rows = [
        *((f"{rule} alert", states) for rule, states in course.alert_levels.items()),
        ("motion", course.motion.states),
        ("condition", course.condition),
        ("reading", reading),
        ("gateway", course.health),
        ("clock", course.clock),
    ]
    for row, (_, states) in enumerate(rows):
        bars: dict[str, list[tuple[float, float]]] = {}
        for from_s, to_s, state in states.spans(course.end_s):
            begin_s, end_s = max(from_s, course.begin_s), min(to_s, course.end_s)
            if end_s > begin_s:
                bars.setdefault(state, []).append((begin_s, end_s - begin_s))
        for state, spans in bars.items():
            _draw_bars(axes, row, state, spans, course.end_s - course.begin_s)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(visible=False)


def _draw_bars(axes: Axes, row: int, state: str, spans: Sequence[tuple[float, float]], length_s: float) -> None:
    """Draw a state in its row at all its times, (begin, length) each, with its name where it fits."""
    colour = COLOURS.get(state, "white")
    axes.broken_barh(
        spans,
        (row - HALF_HEIGHT, 2 * HALF_HEIGHT),
        facecolor=colour,
        edgecolor=MEASURED if colour == "white" else "none",
        linewidth=0.5,
    )
    text = state.replace("_", " ")
    for begin_s, span_s in spans:
        if len(text) * CHARACTER_SHARE < span_s / length_s:
            axes.text(
                begin_s + span_s / 2,
                row,
                text,
                ha="center",
                va="center_baseline",
                fontsize=7,
                color="white" if state in DARK else INK,
                clip_on=True,
            )


def _mark_incident(axes: Axes, facts: IncidentFacts) -> None:
    for time_s in (facts.raised_s, facts.cleared_s):
        if time_s is not None:
            axes.axvline(time_s, color=INK, linewidth=0.9)
    if facts.peak is not None:
        axes.axvline(facts.peak.time_s, color=EVENT, linewidth=0.9, linestyle=":")


def mark_hidden(axes: Axes, course: Course) -> None:
    """Hatch the times in which the load's motion is not in the samples."""
    for gap in course.hidden:
        axes.axvspan(gap.begin_s, gap.end_s, facecolor="none", edgecolor=FAINT, hatch="////", linewidth=0)
