"""The drift watch at rest: hourly means of the static norm against the record's prediction interval.

At rest in one pose the norm is 1 g plus one number: the part of the zero-g offsets along the vertical, and the scale error
there. A housing that hangs shows z offset and z scale as a sum, and nothing of x and y: those read as a lean. So silence here
is no proof of a good calibration; what it cannot see, only calibrating again shows.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from gateway.calibration.correction import Correction
from gateway.calibration.drift.forecast import created
from gateway.calibration.drift.rest_mean import HourSums, RestMean, joined
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.numerics.stats import normal_quantile

Array = NDArray[np.float64]
SECONDS_PER_HOUR = 3600
NS_PER_HOUR = SECONDS_PER_HOUR * 1_000_000_000
HOURS_KEPT = 72
DAYS_KEPT = 400
FEWEST_READINGS = 30
"""At rest in an hour, for its mean to count."""
HOLD_HOURS = 3
"""Hours with rest, one after the other, that must agree before the alarm is raised or cleared."""
NORMAL_995 = normal_quantile(0.995)
REST_GATES = ("complete", "not_clipped", "no_impact", "axes_alive", "quiet", "still", "steady")
"""Of the condition check: all but those that look at the norm."""


def at_rest(gates: Mapping[str, bool]) -> bool:
    """Whether a reading may be fed: by stillness, not by the verdict.

    `static` asks for a norm within the interval, and would hide from this watch what it looks for.
    """
    return all(gates.get(gate, False) for gate in REST_GATES)


class RestState(BaseModel):
    """What survives a restart, as JSON."""

    model_config = ConfigDict(extra="forbid")

    format: int = 1
    calibration_id: str
    open: HourSums | None = None
    hours: list[RestMean] = []
    days: list[RestMean] = []
    alarm_since_hour: int | None = None
    misdated: int = 0
    """Readings whose time was before the record was made, or went back."""


@dataclass(frozen=True, slots=True)
class RestReading:
    """The norm now, against what the record promises."""

    norm_error_g: float
    """Norm less 1 g, over the newest hour with rest."""
    limit_g: float
    """The record's prediction interval (001 eq. 14), or the 99 % interval of its offset and scale where that is wider."""
    direction: tuple[float, float, float]
    """Of up in the housing: the offsets count by these, the scale errors by their squares."""
    temperature_c: float | None
    hour: int
    """Hours since 1970, UTC."""


class RestDriftMonitor:
    """Fed with low-passed readings while the housing is `at_rest`; bounded, reads no clock."""

    def __init__(self, correction: Correction, state: Mapping[str, Any] | None = None) -> None:
        """`state` as `state()` gave it; that of another record is left aside.

        Raises `CalibrationError` where the correction has no record, or one whose time cannot be read.
        """
        if correction.record is None:
            raise CalibrationError(
                "a drift watch needs a calibration record; without one there is nothing to drift from"
            )
        self.record = CalibrationRecord.model_validate(correction.record)
        self._correction = correction
        self._made_hour = int(created(self.record).timestamp()) // SECONDS_PER_HOUR
        self._state = _restored(state, self.record.id)
        self._hours = deque(self._state.hours, maxlen=HOURS_KEPT)
        self._days = deque(self._state.days, maxlen=DAYS_KEPT)

    @property
    def days(self) -> tuple[RestMean, ...]:
        """Means of days with rest, oldest first."""
        return tuple(self._days)

    @property
    def alarm_since_hour(self) -> int | None:
        """Hour in which the norm left the interval for good, in hours since 1970, UTC; None: it has not."""
        return self._state.alarm_since_hour

    @property
    def misdated(self) -> int:
        """Readings whose time was before the record was made, or went back."""
        return self._state.misdated

    def feed(self, time_ns: int, force_g: Array, temperature_c: float | None) -> None:
        """Take a low-passed reading at rest: UTC, specific force of shape (3,) in the housing frame."""
        hour = time_ns // NS_PER_HOUR
        if hour < self._made_hour:
            self._state.misdated += 1  # a gateway whose clock was not set yet
            return
        if self._state.open is not None and hour != self._state.open.hour:
            self._close_hour(self._state.open)
            self._state.open = None
        self._forget_after(hour)
        if self._state.open is None:
            self._state.open = HourSums(hour=hour)
        self._state.open.add(force_g, temperature_c)

    def reading(self) -> RestReading | None:
        """The newest hour with rest; None while there is none."""
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
        """What a restart goes on from, as JSON; under 80 kB."""
        self._state.hours, self._state.days = list(self._hours), list(self._days)
        return self._state.model_dump(mode="json")

    def _close_hour(self, sums: HourSums) -> None:
        if sums.count < FEWEST_READINGS:
            return
        mean = sums.mean()
        self._hours.append(mean)
        if self._days and self._days[-1].hour // 24 == mean.hour // 24:
            self._days[-1] = joined(self._days[-1], mean)
        else:
            self._days.append(mean)
        self._judge()

    def _judge(self) -> None:
        recent = list(self._hours)[-HOLD_HOURS:]
        outside = [abs(mean.norm_g - 1) > self._limit_g(mean) for mean in recent]
        if len(recent) < HOLD_HOURS:
            return
        if all(outside) and self._state.alarm_since_hour is None:
            self._state.alarm_since_hour = recent[0].hour
        elif not any(outside):
            self._state.alarm_since_hour = None

    def _limit_g(self, mean: RestMean) -> float:
        up = np.abs(mean.force_g) / np.linalg.norm(mean.force_g)
        along = np.concatenate([up * self._correction.u_zero_g_offset_g, up**2 * self._correction.u_scale_factor])
        u_norm_g = float(np.linalg.norm(along))
        return max(self._correction.permissible_norm_error_g, NORMAL_995 * u_norm_g)

    def _forget_after(self, hour: int) -> None:
        """The clock went back: what is dated later was dated wrongly, and would be taken for a trend."""
        for means in (self._hours, self._days):
            while means and means[-1].hour > hour:
                self._state.misdated += means.pop().count


def _restored(state: Mapping[str, Any] | None, calibration_id: str) -> RestState:
    """The state of this record; a new one where there is none, or none that can be read."""
    if state is not None:
        try:
            restored = RestState.model_validate(state)
        except ValidationError:  # of another version: a watch that begins anew is worth more than none
            return RestState(calibration_id=calibration_id)
        if restored.calibration_id == calibration_id:
            return restored
    return RestState(calibration_id=calibration_id)
