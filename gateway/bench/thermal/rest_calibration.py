"""Thermal coefficient from service: the magnitude at rest on the rope against temperature.

A housing that hangs at rest reads 1 g along the rope at any temperature. What changes is the sum of the offset and the scale of
the axis along the rope; no reading at rest distinguishes the two, or shows the offset of an axis across the rope. The model that
is learned this way is offered as a new record and comes into force only by a person's decision.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gateway.bench.thermal.hysteresis import NUMBERS, PRIOR_PLAY_G, Explanation, explain, mean_over, play_forms
from gateway.bench.thermal.ramp import AVERAGE_S, element_c
from gateway.bench.thermal.slow_noise import NoiseGrid, RecordingCoefficients, System, block_means
from gateway.calibration.calibration_fit import CalibrationFit, FitWarning
from gateway.calibration.correction import ZERO_G_OFFSET_LIMIT_G_PER_K
from gateway.calibration.input_files import FileReadings
from gateway.calibration.record import THERMAL_REST, CalibrationError, CalibrationRecord, NotDeterminedError
from gateway.calibration.thermal_model import AXES, AxisThermalModel, ThermalModel, holds_at_c
from gateway.calibration.windows import STILL_RATIO, StillnessGate, Window, WindowSplitter
from gateway.errors import InputError
from gateway.numerics.array import Array
from gateway.numerics.stats import means_by_group

MIN_REST_RANGE_C = 5.0
"""Smallest range of the temperatures at rest, °C. Basis: a choice; a day outside has it, and 0.5 mg/°C show as 2.5 mg."""
REST_BLOCKS = 96
"""Largest number of blocks of the windows at rest. Basis: a choice; each has several windows, and a warming shows in it."""
REST_WINDOWS = 20
"""Number of successive still windows that make a rest: 5 s. Basis: a choice; a load swings to and fro in it."""
MIN_RESTS = 12
"""Least number of rests. Basis: a choice; several times the coefficients, and a scatter shows."""
MAX_LEAN_RAD = np.radians(20.0)
"""Largest angle between the axis along the rope and the vertical, radians. Basis: a choice; a load hangs straighter, and a
housing off its rope leans by more."""
MAX_ERROR_G = 0.05
"""Largest deviation of |m| from 1 g that a temperature causes, g. Basis: a larger one is a motion."""


@dataclass(frozen=True, slots=True)
class RestCoefficient:
    """Change of the magnitude at rest with temperature."""

    axis: str
    """Axis of the sensor along the rope."""
    mg_per_c: float
    ci95: tuple[float, float]
    range_c: tuple[float, float]
    rests: int
    """Number of rests of 5 s."""


def learn_at_rest(files: Iterable[FileReadings], parent: CalibrationRecord) -> tuple[CalibrationFit, RestCoefficient]:
    """Return the parent's calibration with a model of the axis along the rope, and its coefficient.

    Raises `InputError` without temperatures, `CalibrationError` for a parent that has a model or another unit,
    `NotDeterminedError` for too little rest or too small a range of temperature.
    """
    if parent.thermal is not None:
        raise CalibrationError(f"record {parent.id} has a thermal model; give the record before it")
    rests = _rests(files, parent)
    up = rests.corrected_g.mean(axis=0)
    up /= np.linalg.norm(up)
    place = int(np.argmax(np.abs(up)))
    if np.abs(up[place]) < np.cos(MAX_LEAN_RAD):
        raise NotDeterminedError("no axis of the sensor lies along the rope; use ramps on the six faces")
    at_rest_c = rests.element_c(0.0)
    low_c, high_c = float(at_rest_c.min()), float(at_rest_c.max())
    if high_c - low_c < MIN_REST_RANGE_C or len(at_rest_c) < MIN_RESTS:
        raise NotDeterminedError(
            f"at rest the temperature varied by {high_c - low_c:.1f} °C in {len(at_rest_c)} rests; "
            f"{MIN_REST_RANGE_C:.0f} °C or more in {MIN_RESTS} or more are needed"
        )
    parent_c = holds_at_c(parent.temperature_c, None)
    reference_c = min(max((low_c + high_c) / 2 if parent_c is None else parent_c, low_c), high_c)
    sensitivity = np.linalg.inv(np.array(parent.correction_matrix))
    per_g = float(sensitivity[place, place])
    slope_g, u_slope_g, factor = _slope_of_axis(rests, place, reference_c, sensitivity[place] / per_g)
    half_g = u_slope_g * factor
    coefficient = RestCoefficient(
        AXES[place],
        1000 * slope_g,
        (1000 * (slope_g - half_g), 1000 * (slope_g + half_g)),
        (low_c, high_c),
        len(at_rest_c),
    )
    model = _model(parent, place, slope_g * per_g, u_slope_g * per_g, reference_c, (low_c, high_c))
    return _with_model(parent, model, coefficient), coefficient


@dataclass(frozen=True, slots=True)
class _Rests:
    """The still windows of some files, w of them, and the thermometers' averages over the whole of each file."""

    span_s: tuple[Array, ...]
    """Begin and end of each rest, (r, 2), for each file."""
    corrected_g: Array
    """Mean reading, corrected by the parent, shape (w, 3)."""
    thermometer: tuple[tuple[Array, Array], ...]
    """Times, s, and temperatures, °C, for each file."""

    @property
    def place(self) -> Array:
        """Times from -1/2 to 1/2 of the duration, one file after the other, shape (w,)."""
        lengths = [float(span_s[-1, 1] - span_s[0, 0]) for span_s in self.span_s]
        starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
        along = np.concatenate(
            [start + span_s.mean(axis=1) - span_s[0, 0] for start, span_s in zip(starts, self.span_s, strict=True)]
        )
        return np.asarray(along / max(sum(lengths), np.finfo(float).tiny) - 0.5)

    def element_c(self, lag_s: float) -> Array:
        """Return the mean temperature of the element in each rest, shape (w,)."""
        means = []
        for span_s, (at_s, known_c) in zip(self.span_s, self.thermometer, strict=True):
            element = element_c(at_s, known_c, lag_s)
            integral = np.concatenate([[0.0], np.cumsum(np.diff(at_s) * (element[1:] + element[:-1]) / 2)])
            begin, end = np.clip(span_s, at_s[0], at_s[-1]).T
            means.append((np.interp(end, at_s, integral) - np.interp(begin, at_s, integral)) / (end - begin))
        return np.concatenate(means)


def _rests(files: Iterable[FileReadings], parent: CalibrationRecord) -> _Rests:
    matrix, offset = np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64)
    spans, means, thermometers = [], [], []
    for file in files:
        if file.unit != parent.unit:
            raise InputError(f"{file.path}: is in {file.unit}, record {parent.id} in {parent.unit}")
        if file.temperature_c is None or np.isnan(file.temperature_c).all():
            raise InputError(f"{file.path}: has no temperature; give recordings of a device that reports it")
        span_s, raw = _find_rests(file, 1 / float(np.abs(np.diag(matrix)).max()))
        corrected_g = (raw - offset) @ matrix.T
        kept = np.abs(np.linalg.norm(corrected_g, axis=1) - 1) < MAX_ERROR_G
        if kept.any():
            spans.append(span_s[kept])
            means.append(corrected_g[kept])
            thermometers.append(_averages(file.time_s, file.temperature_c))
    if not means:
        raise NotDeterminedError("no rest with a temperature in the recordings")
    return _Rests(tuple(spans), np.concatenate(means), tuple(thermometers))


def _averages(time_s: Array, temperature_c: Array) -> tuple[Array, Array]:
    known = ~np.isnan(temperature_c)
    columns = np.column_stack([time_s[known], temperature_c[known]])
    means, _ = means_by_group(np.floor((columns[:, 0] - columns[0, 0]) / AVERAGE_S), columns)
    return means[:, 0], means[:, 1]


def _find_rests(file: FileReadings, units_per_g: float) -> tuple[Array, Array]:
    """Return begin and end, (r, 2), and the mean reading, (r, 3), of each rest: successive still windows that agree.

    A swing is slow at its turning points, where single windows are still.
    """
    gate, splitter = StillnessGate(units_per_g), WindowSplitter()
    run: list[Window] = []
    found = []
    for readings in file.blocks():
        for window in splitter.feed(readings):
            run = [*([] if window.after_gap else run), window] if gate.is_still(window) else []
            if len(run) == REST_WINDOWS:
                means = np.array([one.mean for one in run])
                allowed = max(STILL_RATIO * gate.noise_g * units_per_g / np.sqrt(window.count), window.step)
                if np.max(means.std(axis=0)) <= allowed:
                    found.append(((run[0].start_s, window.end_s), means.mean(axis=0)))
                run = []
    return np.array([span_s for span_s, _ in found]).reshape(-1, 2), np.array([mean for _, mean in found]).reshape(
        -1, 3
    )


class _RestModel:
    """The windows in blocks, and the systems of their readings against temperature and time."""

    def __init__(self, rests: _Rests, along: int, known_c: float) -> None:
        self._rests, self._along, self._known_c = rests, along, known_c
        self._blocks = min(REST_BLOCKS, len(rests.corrected_g))
        self._place = self._in_blocks(rests.place)
        self.grid = NoiseGrid(self._place, has_drift=False)
        forms = play_forms(rests.element_c(0.0)[None])[:, 0]
        in_blocks = np.stack([block_means(each, self._blocks) for each in forms])
        self._plays = [
            np.zeros((self._blocks, 0)),
            *(PRIOR_PLAY_G * (in_blocks - in_blocks.mean(axis=1, keepdims=True))),
        ]
        self._variance_g2 = 0.0
        fits = [self._straight(readings) for readings in np.delete(rests.corrected_g, along, axis=1).T]
        self._across_g = np.array([fit.values[1] for fit in fits])
        self.u_across_g = np.array([np.sqrt(fit.covariance[1, 1]) for fit in fits])
        """Of the change of the axes across the rope, g/°C, without which their readings are the lean, shape (2,)."""
        self._variance_g2 = self._straight(self._error_g(0.0, self._across_g)).sigma ** 2

    def _in_blocks(self, values: Array) -> Array:
        return block_means(values[:, None], self._blocks)[:, 0]

    def _change_c(self, lag_s: float) -> Array:
        return self._rests.element_c(lag_s) - self._known_c

    def _system(self, lag_s: float, play: int, readings: Array) -> System:
        """Return design and readings, (w,), against temperature, a drift in time and a hysteresis."""
        plays = self._plays[play]
        design = np.column_stack([self._in_blocks(self._change_c(lag_s)), self._place, plays])
        known = np.append(np.zeros(2), np.full(plays.shape[1], self._variance_g2))
        return design[None], self._in_blocks(readings)[None], known

    def _straight(self, readings: Array) -> RecordingCoefficients:
        """Return the fit of readings, (w,), without lag and hysteresis."""
        system = self._system(0.0, 0, readings)
        return self.grid.estimate([system])[0].solve(*system)

    def _error_g(self, lag_s: float, across_g: Array) -> Array:
        """Return the error of the axis along the rope, (w,): its reading less what |m| = 1 leaves it beside the lean."""
        lean = np.delete(self._rests.corrected_g, self._along, axis=1) - np.outer(self._change_c(lag_s), across_g)
        reading = self._rests.corrected_g[:, self._along]
        return np.asarray(reading - np.sign(reading) * np.sqrt(np.maximum(0.0, 1 - (lean**2).sum(axis=1))))

    def systems(self, lag_s: float, play: int) -> list[System]:
        """Return the system of the axis along the rope."""
        return [self._system(lag_s, play, self._error_g(lag_s, self._across_g))]

    def fit(self, one: Explanation, lag_s: float, more_across_g: Array) -> tuple[RecordingCoefficients, Array]:
        """Return the fit by a hypothesis at a lag, and the changes of the three axes, g/°C."""
        across_g = self._across_g + more_across_g
        fit = one.noise.solve(*self._system(lag_s, one.play, self._error_g(lag_s, across_g)))
        return fit, np.insert(across_g, self._along, fit.values[1])


def _slope_of_axis(rests: _Rests, along: int, known_c: float, to_axis: Array) -> tuple[float, float, float]:
    """Return the slope of the axis along the rope, its standard uncertainty, g/°C, and the coverage factor.

    `to_axis`, (3,), is what the sensitive axis reads of errors along the three axes of the corrected frame.
    """
    model = _RestModel(rests, along, known_c)
    explanations = explain(model.grid, model.systems, dict.fromkeys(NUMBERS, 0.0))
    values, covariances, fits = [], [], []
    for one in explanations:
        fit, changes_g = model.fit(one, one.lag_s, np.zeros(2))
        shifted = [model.fit(one, one.lag_s + one.u_lag_s, np.zeros(2))[1]]
        shifted += [model.fit(one, one.lag_s, more_g)[1] for more_g in np.diag(model.u_across_g)]
        parts = np.array(
            [*(to_axis @ (each - changes_g) for each in shifted), to_axis[along] * np.sqrt(fit.covariance[1, 1])]
        )
        values.append(np.array([to_axis @ changes_g]))
        covariances.append(np.square(parts)[:, None, None])
        fits.append(fit)
    mean, causes = mean_over(explanations, values, covariances)
    row = np.eye(len(fits[0].values))[1]
    return float(mean[0]), float(np.sqrt(causes.sum())), fits[0].coverage_factor(row)


def _model(
    parent: CalibrationRecord,
    place: int,
    slope: float,
    u_slope: float,
    reference_c: float,
    range_c: tuple[float, float],
) -> ThermalModel:
    """Return the model; an axis across the rope keeps the limit of a data sheet as its uncertainty (GUM 4.3.7)."""
    per_g = 1 / np.abs(np.diag(np.array(parent.correction_matrix)))
    unknown = ZERO_G_OFFSET_LIMIT_G_PER_K / np.sqrt(3) * per_g
    axes = {
        axis: AxisThermalModel(
            offset_per_c=[slope if number == place else 0.0],
            scale_per_c=[0.0],
            covariance=[[float(u_slope**2 if number == place else unknown[number] ** 2), 0.0], [0.0, 0.0]],
        )
        for number, axis in enumerate(AXES)
    }
    return ThermalModel(source="rest", reference_c=reference_c, min_c=range_c[0], max_c=range_c[1], axes=axes)


def _with_model(parent: CalibrationRecord, model: ThermalModel, coefficient: RestCoefficient) -> CalibrationFit:
    x, y, z = parent.offset
    text = (
        f"learned at rest: axis {coefficient.axis} along the rope, {coefficient.mg_per_c:+.3f} mg/°C "
        f"[{coefficient.ci95[0]:+.3f}, {coefficient.ci95[1]:+.3f}], the sum of offset and scale; other axes were not measured"
    )
    return CalibrationFit(
        method=THERMAL_REST,
        offset=(x, y, z),
        correction_matrix=np.array(parent.correction_matrix),
        covariance=np.array(parent.covariance),
        prediction_interval_g=float(parent.prediction_interval_g),
        poses=(),
        temperature_c={"mean": model.reference_c, "min": model.min_c, "max": model.max_c},
        misalignment_deg={
            axis: [float(angle) for angle in angles] for axis, angles in (parent.misalignment_deg or {}).items()
        },
        residual_rms_g=float(parent.residual_rms_g or 0.0),
        condition_number=1.0,
        budget=tuple(entry.model_dump() for entry in parent.budget),
        warnings=(FitWarning(text),),
        thermal=model.model_dump(mode="json"),
    )
