"""The drift monitor at rest: hourly means of the magnitude against the prediction interval of the record.

At rest in one pose the magnitude is 1 g plus one number: the component of the zero-g offsets along the vertical, and the scale
error there. A hanging housing shows the sum of z offset and z scale, and nothing of x and y, which read as a lean. The absence
of an alarm therefore does not prove the calibration; a new calibration shows the rest.

The means of low-pass filtered readings are taken over an hour, and over the hours of a day.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.calibration.correction import Correction
from gateway.calibration.record import CalibrationError, CalibrationRecord, created_at
from gateway.numerics.array import Array
from gateway.numerics.stats import normal_quantile
from gateway.units import HOURS_PER_DAY

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
SECONDS_PER_HOUR = 3600
NS_PER_HOUR = SECONDS_PER_HOUR * 1_000_000_000
MAX_HOURS = 72
"""Number of hourly means that are kept: three days. Basis: a choice; several times `HOLD_HOURS`, so that a weekend without rest
loses nothing."""
MAX_DAYS = 400
"""Number of daily means that are kept. Basis: more than a year between two calibrations."""
MIN_HOUR_READINGS = 30
"""Least number of readings at rest in an hour whose mean counts. Basis: a choice; the mean is some times better than a reading,
and a crane that works rests as often in an hour."""
HOLD_HOURS = 3
"""Number of successive hours with rest that must agree before the alarm is raised or cleared. Basis: a choice; an hour in the sun
does not raise the alarm, and a shock is told on the same day."""
NORMAL_995 = normal_quantile(0.995)
"""Coverage factor of a two-sided 99 % interval of a normal variable. Definition: a quantile."""
REST_GATES = ("complete", "not_clipped", "no_impact", "axes_alive", "quiet", "still", "steady")
"""Gates of the condition that a reading at rest meets: all gates that do not depend on the magnitude."""


class RestMean(BaseModel):
    """A mean of readings at rest."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    hour: int
    """Hours since 1970, UTC; for a day its newest hour with rest."""
    count: int = Field(gt=0)
    """Number of readings."""
    norm_g: float = Field(gt=0)
    """Mean of the magnitudes, g."""
    force_g: Vector
    """Mean specific force in the housing frame, g."""
    temperature_c: float | None


class HourSums(BaseModel):
    """Sums over the readings of the current hour."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    hour: int
    count: int = 0
    norm_g: float = 0.0
    force_g: Vector = [0.0, 0.0, 0.0]
    temperature_c: float = 0.0
    temperatures: int = 0
    """Number of readings with a temperature."""

    def add(self, force_g: Array, temperature_c: float | None) -> None:
        """Add a reading, shape (3,)."""
        self.count += 1
        self.norm_g += float(np.linalg.norm(force_g))
        self.force_g = [total + float(value) for total, value in zip(self.force_g, force_g, strict=True)]
        if temperature_c is not None:
            self.temperature_c += temperature_c
            self.temperatures += 1

    def mean(self) -> RestMean:
        """Return the mean of the readings; there must be at least one."""
        return RestMean(
            hour=self.hour,
            count=self.count,
            norm_g=self.norm_g / self.count,
            force_g=[total / self.count for total in self.force_g],
            temperature_c=self.temperature_c / self.temperatures if self.temperatures else None,
        )


def combine_means(earlier: RestMean, later: RestMean) -> RestMean:
    """Return the mean of two means, weighted by their counts."""
    count = earlier.count + later.count
    a, b = earlier.count / count, later.count / count
    temperature_c = None
    if earlier.temperature_c is not None and later.temperature_c is not None:
        temperature_c = a * earlier.temperature_c + b * later.temperature_c
    return RestMean(
        hour=later.hour,
        count=count,
        norm_g=a * earlier.norm_g + b * later.norm_g,
        force_g=[a * x + b * y for x, y in zip(earlier.force_g, later.force_g, strict=True)],
        temperature_c=temperature_c,
    )


def is_at_rest(gates: Mapping[str, bool]) -> bool:
    """Return whether the monitor may use a reading, by the gates of its stillness.

    The verdict `static` requires a magnitude within the interval, so it would hide a drift from the monitor.
    """
    return all(gates.get(gate, False) for gate in REST_GATES)


class RestState(BaseModel):
    """State of the monitor that survives a restart, as JSON."""

    model_config = ConfigDict(extra="forbid")

    format: int = 1
    calibration_id: str
    open: HourSums | None = None
    """Sums of the current hour."""
    hours: list[RestMean] = []
    days: list[RestMean] = []
    alarm_since_hour: int | None = None
    misdated: int = 0
    """Number of readings with a time before the record was made, or after which the clock went back."""


@dataclass(frozen=True, slots=True)
class RestReading:
    """The magnitude at rest against the limit of the record."""

    norm_error_g: float
    """Mean magnitude of the newest hour with rest minus 1 g, g."""
    limit_g: float
    """Prediction interval of the record (Łuczak n.d., eq. 14), or the 99 % interval of offset and scale if that is wider, g."""
    direction: tuple[float, float, float]
    """Unit vector to the vertical in the housing: weights of the offsets; their squares are the weights of the scale errors."""
    temperature_c: float | None
    hour: int
    """Hours since 1970, UTC."""


class RestDriftMonitor:
    """Monitors the drift from low-pass filtered readings at rest; its memory is bounded and it reads no clock."""

    def __init__(self, correction: Correction, state: Mapping[str, Any] | None = None) -> None:
        """`state` is a result of `state()`; the state of another record is ignored.

        Raises `CalibrationError` if the correction has no record, or a record whose time cannot be read.
        """
        if correction.record is None:
            raise CalibrationError("a drift monitor needs a calibration record as its reference")
        self.record = CalibrationRecord.model_validate(correction.record)
        self._correction = correction
        self._created_hour = int(created_at(self.record).timestamp()) // SECONDS_PER_HOUR
        self._state = _restore_state(state, self.record.id)
        self._hours = deque(self._state.hours, maxlen=MAX_HOURS)
        self._days = deque(self._state.days, maxlen=MAX_DAYS)

    @property
    def days(self) -> tuple[RestMean, ...]:
        """Means of the days with rest, oldest first."""
        return tuple(self._days)

    @property
    def alarm_since_hour(self) -> int | None:
        """Hour since which the magnitude is outside the interval, in hours since 1970, UTC; None: no alarm."""
        return self._state.alarm_since_hour

    @property
    def misdated(self) -> int:
        """Number of readings with a time before the record was made, or after which the clock went back."""
        return self._state.misdated

    def feed(self, time_ns: int, force_g: Array, temperature_c: float | None) -> None:
        """Add a low-pass filtered reading at rest: UTC, specific force in the housing frame, shape (3,)."""
        hour = time_ns // NS_PER_HOUR
        if hour < self._created_hour:
            self._state.misdated += 1  # the clock of the gateway was not set yet
            return
        if self._state.open is not None and hour != self._state.open.hour:
            self._close_hour(self._state.open)
            self._state.open = None
        self._discard_after(hour)
        if self._state.open is None:
            self._state.open = HourSums(hour=hour)
        self._state.open.add(force_g, temperature_c)

    def reading(self) -> RestReading | None:
        """Return the reading of the newest hour with rest; None if there is none."""
        if not self._hours:
            return None
        mean = self._hours[-1]
        x, y, z = np.array(mean.force_g) / np.linalg.norm(mean.force_g)
        return RestReading(
            norm_error_g=mean.norm_g - 1,
            limit_g=self._limit_g(mean),
            direction=(float(x), float(y), float(z)),
            temperature_c=mean.temperature_c,
            hour=mean.hour,
        )

    def state(self) -> dict[str, Any]:
        """Return the state from which a restart continues, as JSON of less than 120 kB."""
        self._state.hours, self._state.days = list(self._hours), list(self._days)
        return self._state.model_dump(mode="json")

    def _close_hour(self, sums: HourSums) -> None:
        if sums.count < MIN_HOUR_READINGS:
            return
        mean = sums.mean()
        self._hours.append(mean)
        if self._days and self._days[-1].hour // HOURS_PER_DAY == mean.hour // HOURS_PER_DAY:
            self._days[-1] = combine_means(self._days[-1], mean)
        else:
            self._days.append(mean)
        self._update_alarm()

    def _update_alarm(self) -> None:
        recent = list(self._hours)[-HOLD_HOURS:]
        is_outside = [abs(mean.norm_g - 1) > self._limit_g(mean) for mean in recent]
        if len(recent) < HOLD_HOURS:
            return
        if all(is_outside) and self._state.alarm_since_hour is None:
            self._state.alarm_since_hour = recent[0].hour
        elif not any(is_outside):
            self._state.alarm_since_hour = None

    def _limit_g(self, mean: RestMean) -> float:
        up = np.abs(mean.force_g) / np.linalg.norm(mean.force_g)
        along = np.concatenate([up * self._correction.u_zero_g_offset_g, up**2 * self._correction.u_scale_factor])
        u_norm_g = float(np.linalg.norm(along))
        return max(self._correction.permissible_norm_error_g, NORMAL_995 * u_norm_g)

    def _discard_after(self, hour: int) -> None:
        """Discard means that are dated later: the clock was wrong, and they would show a false trend."""
        for means in (self._hours, self._days):
            while means and means[-1].hour > hour:
                self._state.misdated += means.pop().count


def _restore_state(state: Mapping[str, Any] | None, calibration_id: str) -> RestState:
    """Return the state of this record, or a new one if there is none that can be read."""
    if state is not None:
        try:
            restored = RestState.model_validate(state)
        except ValidationError:  # of another version: a new state is better than no monitor
            return RestState(calibration_id=calibration_id)
        if restored.calibration_id == calibration_id:
            return restored
    return RestState(calibration_id=calibration_id)
