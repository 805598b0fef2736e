"""Deflection of a girder over time: from two recordings of its ends, with the report, and from two live gateways."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.bench.girder_deflection import (
    DEFLECTION_AVERAGE_S,
    Deflection,
    EndRotation,
    Girder,
    InwardAxis,
    girder_deflection,
    inward_tilt_rad,
    relative_u_of_correction,
)
from gateway.calibration.record import FigureSeries, RecordFigure
from gateway.certificate.bench_report import ReportTable, render_bench_report
from gateway.documents.format import format_fixed, format_with_uncertainty
from gateway.errors import InputError
from gateway.measurement.source import Source
from gateway.messages import Tilt
from gateway.numerics.array import Array
from gateway.numerics.stats import correlation_sum

MIN_ZERO_BINS = 5
"""Least number of averages of the zero. Basis: their scatter is known."""
MAX_DEFLECTION_POINTS = 2000
"""Points of the figure; more are thinned. Basis: a choice; more than a figure has pixels."""
Side = Literal["left", "right"]
MAX_AVERAGED_TILTS = 64
"""Largest number of tilts of an average, which bounds memory. Basis: a choice; an average has ten at ten tilts per second; six
times as many bound the memory."""
MIN_AVERAGED_TILTS = 5
"""Fewest tilts of an average. Basis: a choice; half of what comes in `DEFLECTION_AVERAGE_S`."""
MAX_APART_S = 1.0
"""Largest difference between the newest tilts of both ends, s; beyond it one of them is stale, or the clocks differ. Basis: a
choice; ten tilts, and one average."""


@dataclass(frozen=True, slots=True)
class DeflectionSeries:
    """Deflection in averages of a second, after the zero."""

    time_s: Array
    """Middle of each average, from the beginning of the zero, shape (n,)."""
    deflections: tuple[Deflection, ...]
    zero_s: float
    """Duration of the zero."""

    @property
    def largest(self) -> Deflection:
        """The average with the largest deflection, to either side."""
        return max(self.deflections, key=lambda one: abs(one.deflection_m))

    @property
    def most_turned(self) -> Deflection:
        """The deflection at which an end has turned most: there the load and the axes show best."""
        return max(self.deflections, key=lambda one: max(abs(one.left_rad), abs(one.right_rad)))


@dataclass(frozen=True, slots=True)
class _End:
    """The averages of one end."""

    bins: NDArray[np.int64]
    """Number of each average on the common grid, shape (k,)."""
    tilt_rad: Array
    """Tilt of the inward axis, shape (k,)."""


def deflection_series(
    left: Source, right: Source, girder: Girder, axes: tuple[InwardAxis, InwardAxis], zero_s: float
) -> DeflectionSeries:
    """Return the deflection after a zero of `zero_s` at the beginning of the time that both recordings share.

    Raises `InputError` where they share too little time, or one has a date and the other none.
    """
    begins_s = [_absolute_time_s(source) for source in (left, right)]
    if (left.extent.origin_utc_ns is None) != (right.extent.origin_utc_ns is None):
        raise InputError(
            f"{right.name}: one recording has dates and the other none; give two .mcap, or two .csv of one clock"
        )
    start_s, end_s = max(times[0] for times in begins_s), min(times[-1] for times in begins_s)
    if end_s - start_s < zero_s + DEFLECTION_AVERAGE_S:
        raise InputError(
            f"{left.name} and {right.name} share {max(end_s - start_s, 0):.1f} s; the zero of {zero_s:g} s and a load need more"
        )
    ends = [
        _average(times - start_s, source, axis, end_s - start_s)
        for times, source, axis in zip(begins_s, (left, right), axes, strict=True)
    ]
    n_zero = int(zero_s / DEFLECTION_AVERAGE_S)
    common = np.intersect1d(ends[0].bins, ends[1].bins)
    loaded = common[common >= n_zero].astype(np.int64)
    if not len(loaded):
        raise InputError(f"{left.name} and {right.name}: no second after the zero has samples of both")
    left_end, right_end = (
        _rotations(end, source, axis, n_zero, loaded)
        for end, source, axis in zip(ends, (left, right), axes, strict=True)
    )
    return DeflectionSeries(
        time_s=np.asarray((loaded + 0.5) * DEFLECTION_AVERAGE_S, dtype=np.float64),
        deflections=tuple(girder_deflection(*pair, girder) for pair in zip(left_end, right_end, strict=True)),
        zero_s=n_zero * DEFLECTION_AVERAGE_S,
    )


def _absolute_time_s(source: Source) -> Array:
    origin_ns = source.extent.origin_utc_ns
    return source.recording.time_s + (0.0 if origin_ns is None else origin_ns * 1e-9)


def _average(time_s: Array, source: Source, axis: InwardAxis, duration_s: float) -> _End:
    inside = (time_s >= 0) & (time_s < duration_s)
    bins, place = np.unique(np.floor(time_s[inside] / DEFLECTION_AVERAGE_S).astype(np.int64), return_inverse=True)
    count = np.bincount(place)
    force_g = np.column_stack([np.bincount(place, values) / count for values in source.force_g[inside].T])
    full = count >= 0.5 * DEFLECTION_AVERAGE_S * source.recording.rate_hz
    return _End(bins[full], inward_tilt_rad(force_g[full], axis))


def _rotations(
    end: _End, source: Source, axis: InwardAxis, n_zero: int, loaded: NDArray[np.int64]
) -> list[EndRotation]:
    """Return the rotation in each average of `loaded` against the mean of the zero."""
    zero_rad = end.tilt_rad[end.bins < n_zero]
    if len(zero_rad) < MIN_ZERO_BINS:
        raise InputError(
            f"{source.name}: {len(zero_rad)} s of the zero have samples; it needs {MIN_ZERO_BINS} s or more"
        )
    scatter_rad = float(zero_rad.std(ddof=1))
    u_zero_rad = scatter_rad * float(np.sqrt(max(1.0, correlation_sum(zero_rad)) / len(zero_rad)))
    u_relative = relative_u_of_correction(source.correction, source.permissible_norm_error_g, axis[0])
    u_random_rad = float(np.hypot(scatter_rad, u_zero_rad))
    tilt_rad = end.tilt_rad[np.searchsorted(end.bins, loaded)]
    zero = float(zero_rad.mean())
    return [EndRotation(zero - float(tilt), u_random_rad, u_relative) for tilt in tilt_rad]


def render_deflection_report(
    names: tuple[str, str],
    girder_text: str,
    stated: Sequence[tuple[str, str]],
    time_s: Sequence[float],
    deflection_mm: Sequence[float],
    u_mm: Sequence[float],
    warnings: Sequence[str],
) -> str:
    """Return the page; `stated` are further facts; the series are of equal length, one at least."""
    place = max(range(len(deflection_mm)), key=lambda number: abs(deflection_mm[number]))
    every = -(-len(time_s) // MAX_DEFLECTION_POINTS)
    series = FigureSeries(
        name="mid-span", x=tuple(time_s[::every]), y=tuple(deflection_mm[::every]), u=tuple(u_mm[::every])
    )
    return render_bench_report(
        "Deflection of a girder",
        facts=(("Left end", names[0]), ("Right end", names[1]), ("Girder", girder_text), *stated),
        tables=(
            ReportTable(
                "Largest deflection at mid-span",
                ("time / s", "deflection / mm"),
                ((format_fixed(time_s[place], 1), format_with_uncertainty(deflection_mm[place], u_mm[place])),),
                "Positive downwards, k = 2, from the rotations of both ends (Zhu et al. 2020, eq. 25). It holds for a girder on "
                "two simple supports and small bending.",
            ),
        ),
        figures=(
            RecordFigure(
                title="Deflection at mid-span",
                x_label="time / s",
                y_label="deflection / mm",
                series=(series,),
                caption="Averages of 1 s; bars: ± 2 u.",
            ),
        ),
        warnings=warnings,
    )


@dataclass(frozen=True, slots=True)
class DeflectionReadout:
    """What a person sees: the deflection, or why there is none."""

    deflection: Deflection | None
    text: str
    """The reason; empty with a deflection."""


@dataclass(slots=True)
class _LiveEnd:
    axis: InwardAxis
    u_relative: float
    recent: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=MAX_AVERAGED_TILTS))
    """Time, ns, and tilt, rad, of the newest trusted tilts."""
    zero: list[float] = field(default_factory=list)
    zero_begin_ns: int | None = None
    reason: str = "no tilt yet"

    def add(self, tilt: Tilt, zero_s: float) -> None:
        """Add a message: to the zero while that lasts, then to the average."""
        if not tilt.trusted or tilt.specific_force_g is None:
            self.recent.clear()
            self.reason = "the reading is not trusted: it moves or vibrates"
            return
        angle_rad = float(inward_tilt_rad(np.array(tilt.specific_force_g), self.axis))
        self.reason = ""
        if self.zero_begin_ns is None:
            self.zero_begin_ns = tilt.time_ns
        if tilt.time_ns - self.zero_begin_ns <= zero_s * 1e9:
            self.zero.append(angle_rad)
        self.recent.append((tilt.time_ns, angle_rad))
        while tilt.time_ns - self.recent[0][0] > DEFLECTION_AVERAGE_S * 1e9:
            self.recent.popleft()

    def rotation(self) -> EndRotation:
        """Return the mean rotation; an average of correlated tilts is taken to be no better than one of them."""
        scatter_rad = float(np.std(self.zero, ddof=1))
        u_rad = float(np.hypot(scatter_rad, scatter_rad / np.sqrt(max(len(self.zero) / 10, 1))))
        mean_rad = float(np.mean([angle_rad for _, angle_rad in self.recent]))
        return EndRotation(float(np.mean(self.zero)) - mean_rad, u_rad, self.u_relative)


class LiveDeflection:
    """Collects a zero from both ends, then gives the deflection with each tilt."""

    def __init__(
        self,
        girder: Girder,
        axes: tuple[InwardAxis, InwardAxis],
        u_relative: tuple[float, float],
        zero_s: float,
    ) -> None:
        self._girder = girder
        self._zero_s = zero_s
        self._ends: dict[Side, _LiveEnd] = {
            "left": _LiveEnd(axes[0], u_relative[0]),
            "right": _LiveEnd(axes[1], u_relative[1]),
        }

    def add(self, side: Side, tilt: Tilt) -> DeflectionReadout:
        """Return the deflection after this tilt of one end."""
        self._ends[side].add(tilt, self._zero_s)
        for name, end in self._ends.items():
            if end.reason or not end.recent:
                return DeflectionReadout(None, f"{name} end: {end.reason or 'no tilt yet'}")
        newest_ns = [end.recent[-1][0] for end in self._ends.values()]
        if max(newest_ns) - min(newest_ns) > MAX_APART_S * 1e9:
            return DeflectionReadout(None, f"the ends are {(max(newest_ns) - min(newest_ns)) / 1e9:.1f} s apart")
        if not all(self._has_zero(end) for end in self._ends.values()):
            return DeflectionReadout(None, f"zero: keep the girder unloaded for {self._zero_s:g} s")
        if min(len(end.recent) for end in self._ends.values()) < MIN_AVERAGED_TILTS:
            return DeflectionReadout(None, "wait: the angles are being averaged")
        left, right = (end.rotation() for end in self._ends.values())
        return DeflectionReadout(girder_deflection(left, right, self._girder), "")

    def _has_zero(self, end: _LiveEnd) -> bool:
        if end.zero_begin_ns is None or len(end.zero) < MIN_AVERAGED_TILTS:
            return False
        return end.recent[-1][0] - end.zero_begin_ns > self._zero_s * 1e9
