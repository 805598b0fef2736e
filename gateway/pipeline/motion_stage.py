"""The motion stage of the pipeline: feeds the motion filter, and derives from it the messages of motion and swing.

The filter takes the angular rates of a device with a gyroscope in the frame of the housing. The condition stage needs a part of
the motion, and gets the condition in the operator's words.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from devices.axes_map import AxesMap, map_axes
from devices.block import DeviceInfo, SampleBlock
from devices.pendulum.small_swing import small_swing_period_s
from devices.saturation import angular_rates
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.messages import Motion, Swing
from gateway.messages.header import Reason
from gateway.motion.description import engineer_reasons, is_cause_distinct, operator_text
from gateway.motion.estimate import MotionEstimate
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.pipeline.compose import motion_message, swing_message
from gateway.pipeline.outgoing_message import Header
from gateway.pipeline.rig import configured_housing, with_sensor
from gateway.stages.condition import ConditionResult, MotionContext
from gateway.swing.data.recent_extremes import RecentExtremes
from gateway.swing.formulas import as_published
from gateway.swing.rig import MountedHousing

BIAS_LIMIT_RAD_S = np.radians(20.0)
"""Limit of the reading at rest of a gyroscope without one in its data sheet."""
DISTURBED = "Reading disturbed"
GYRO_BIAS_RAD_S_PER_K = np.radians(0.05)
"""Change of a gyroscope's bias with temperature, standard uncertainty. Basis: 0.03 (MPU-9250) to 0.16 deg/s/K."""
GYRO_STEP_K = 0.5
"""Change of temperature from which on the bias is widened. Basis: a choice; above the steps of a thermometer (0.1 °C), and 0.025
deg/s of bias by `GYRO_BIAS_RAD_S_PER_K`."""
NOT_CONFIGURED = Reason("not_configured", "where the housing is on the rope is not configured")
SWINGS_PER_PERIOD = 3
"""Messages of the swing in a period. Basis: a choice; the estimate covers whole periods, so that more messages say little that is
new."""
MAX_SWING_INTERVAL_S, UNSETTLED_SWING_INTERVAL_S = 2.5, 1.0
"""Longest time between two of them; while the load rests or the angle is not known. Basis: a choice; a person reads the swing
while it changes, and a load at rest changes in a second as well."""
MAX_KEPT_PERIODS = 2.0
"""Periods of the rope as configured for which extremes are kept. Basis: a rope four times as long."""
TEMPERATURE_HYSTERESIS_K = 1
"""Basis: a temperature that varies about a whole kelvin changes nothing again and again."""


def gyro_prior(bias_limit_rad_s: float | None = None, noise_rad_s: float | None = None) -> GyroPrior:
    """Return what is known of a gyroscope before its first reading: a bias anywhere within its limit."""
    return GyroPrior((BIAS_LIMIT_RAD_S if bias_limit_rad_s is None else bias_limit_rad_s) / 3**0.5, noise_rad_s)


def device_gyro(info: DeviceInfo) -> GyroPrior | None:
    """Return what is known of a device's gyroscope; None where it has none."""
    if info.gyro_rad_s_per_count is None:
        return None
    return gyro_prior(info.gyro_bias_rad_s, info.gyro_noise_rad_s)


def housing_rates(blocks: Sequence[SampleBlock], rad_s_per_count: float | None, axes: AxesMap) -> Array | None:
    """Return the rates of consecutive blocks, shape (n, 3), NaN where a sample has none; None without a gyroscope."""
    if rad_s_per_count is None:
        return None
    parts = [_rates(block.gyro_counts, len(block), rad_s_per_count) for block in blocks]
    return map_axes(np.concatenate(parts), axes)


def _rates(counts: NDArray[np.int32] | None, length: int, rad_s_per_count: float) -> Array:
    if counts is None:
        return np.full((length, 3), np.nan)
    return angular_rates(counts, rad_s_per_count)


def motion_context(estimate: MotionEstimate, rig: MountedHousing | None, *, is_explained: bool) -> MotionContext:
    """Return the motion as the condition stage needs it; `rig` is None where the housing's position is not known."""
    largest, length_m = estimate.last_peak, estimate.length_m
    return MotionContext(
        state=estimate.state,
        u_rad=estimate.u_rad,
        phi_max_rad=None if largest is None else largest.upper_rad(NORMAL_975),
        amplitude_rad=estimate.amplitude_rad,
        period_s=estimate.period_s,
        rho=None if rig is None or length_m is None else rig.rho_at(length_m),
        is_explained=is_explained,
        is_cause_distinct=is_cause_distinct(estimate),
        reasons=engineer_reasons(estimate),
    )


def condition_text(result: ConditionResult, estimate: MotionEstimate) -> str:
    """Return the condition as one line for the operator."""
    if result.verdict == "disturbed":
        return f"{DISTURBED}: {result.reasons[0]}."
    if result.verdict == "unknown":
        return f"Not known: {result.reasons[0]}."
    if result.verdict in ("static", "quasi_static"):
        return "Load at rest." if result.verdict == "static" else "Load at rest, with vibration."
    if estimate.state == "rest":
        return "Load almost at rest."
    return operator_text(estimate)


class MotionStage:
    """Keeps the motion of the rope at the newest sample."""

    def __init__(self, configuration: Configuration, info: DeviceInfo, correction: Correction) -> None:
        rig = configured_housing(configuration, correction, info.bandwidth_hz)
        self._rig, self._correction, self._bandwidth_hz = rig, correction, info.bandwidth_hz
        self._monitor = None
        if rig is not None:
            mount_u_rad = math.hypot(math.radians(configuration.housing.mount_u_deg), correction.u_cross_axis)
            self._monitor = MotionMonitor(rig, mount_u_rad=mount_u_rad, noise_g=info.noise_g, gyro=device_gyro(info))
        longest_s = MAX_KEPT_PERIODS * small_swing_period_s(
            configuration.rope.length_m, configuration.site.local_gravity_m_s2
        )
        self._extremes = RecentExtremes(longest_s)
        self._clipped_s = -math.inf
        """Time of the last clipped sample, by which the published formulas are wrong for a period."""
        self._is_new = True
        self._beyond_k = 0
        self._gyro_temperature_c: float | None = None
        """Temperature at which the gyroscope's bias was last widened."""
        self._swing_due_s = -math.inf
        self.estimate = _unknown(0.0, Reason("no_reading", "no reading yet"))

    def restart(self, why: Reason) -> None:
        """Forget the past, as while the housing is off the rope."""
        if self._monitor is not None and not self._is_new:
            self._monitor.restart()
            self._is_new = True
        self.set_unknown(why)

    def set_unknown(self, why: Reason) -> None:
        """Make the motion unknown until the next samples."""
        self.estimate = _unknown(self.estimate.time_s, why)

    def update(
        self,
        time_s: Array,
        force_g: Array,
        lowpassed_g: Array,
        is_clipped: NDArray[np.bool_] | None = None,
        temperature_c: float | None = None,
        rate_rad_s: Array | None = None,
    ) -> bool:
        """Take the samples since the last call; return whether a swing message is due.

        `is_clipped`: which of them are, shape (n,); None: none. `temperature_c`: that of the sensor; outside the calibration's
        range it widens the intervals. `rate_rad_s`: angular rates in the housing frame, shape (n, 3); None without a gyroscope.
        """
        now_s = float(time_s[-1])
        if self._monitor is None:
            self.estimate = _unknown(now_s, NOT_CONFIGURED)
            return False
        self._is_new = False
        self._follow_temperature(self._monitor, temperature_c)
        if rate_rad_s is not None:
            self._follow_gyro_temperature(self._monitor, temperature_c)
        self._monitor.update(time_s, force_g, is_clipped, rate_rad_s)
        self._extremes.update(time_s, lowpassed_g)
        if is_clipped is not None and is_clipped.any():
            self._clipped_s = now_s
        self.estimate = self._monitor.estimate(now_s)
        return self._is_swing_due(now_s)

    def without_gyro_bias(self, rate_rad_s: Array | None) -> Array | None:
        """Return a gyroscope's readings without that at rest; None where it is not known, or without a gyroscope in use."""
        bias_rad_s = None if self._monitor is None else self._monitor.gyro_bias_rad_s()
        return None if rate_rad_s is None or bias_rad_s is None else rate_rad_s - bias_rad_s

    def condition_context(self) -> MotionContext:
        """Return the part of the motion that the condition stage needs."""
        is_explained = self._monitor is None or self._monitor.is_explained
        return motion_context(self.estimate, self._rig, is_explained=is_explained)

    def motion_message(self, header: Header) -> Motion:
        """Return the motion in degrees."""
        return motion_message(header, self.estimate)

    def swing_message(self, header: Header) -> Swing:
        """Return the swing of the last period in degrees, with the published formulas over the same period."""
        period_s = self.estimate.period_s
        if period_s is None or self._clipped_s > self.estimate.time_s - period_s:
            return swing_message(header, self.estimate, None)
        found = self._extremes.since(self.estimate.time_s - period_s)
        return swing_message(header, self.estimate, None if found is None else as_published(found))

    def _is_swing_due(self, now_s: float) -> bool:
        if now_s < self._swing_due_s:
            return False
        interval_s = UNSETTLED_SWING_INTERVAL_S
        if self.estimate.period_s is not None and self.estimate.state not in ("rest", "unknown"):
            interval_s = min(self.estimate.period_s / SWINGS_PER_PERIOD, MAX_SWING_INTERVAL_S)
        self._swing_due_s = now_s + interval_s
        return True

    def _follow_gyro_temperature(self, monitor: MotionMonitor, temperature_c: float | None) -> None:
        """Let the gyroscope's bias change with the temperature."""
        if temperature_c is None:
            return
        before_c, self._gyro_temperature_c = self._gyro_temperature_c, temperature_c
        if before_c is None:
            return
        if abs(change_k := temperature_c - before_c) < GYRO_STEP_K:
            self._gyro_temperature_c = before_c
        else:
            monitor.widen_gyro_bias(GYRO_BIAS_RAD_S_PER_K * abs(change_k))

    def _follow_temperature(self, monitor: MotionMonitor, temperature_c: float | None) -> None:
        """Widen the intervals where the temperature leaves, or returns to, that of the calibration."""
        beyond_k = self._correction.kelvin_beyond(temperature_c)
        if self._rig is None or abs(beyond_k - self._beyond_k) <= TEMPERATURE_HYSTERESIS_K:
            return
        change_k = abs(beyond_k - self._beyond_k)
        self._beyond_k = beyond_k
        rig = with_sensor(self._rig, self._correction.widened_by(beyond_k), self._bandwidth_hz)
        offset_u_g = change_k * self._correction.u_zero_g_offset_g_per_k
        axial_u_g = math.hypot(offset_u_g, change_k * self._correction.u_scale_factor_per_k)
        change_u_g = np.array([offset_u_g, offset_u_g, axial_u_g])
        warnings = tuple(Reason("temperature", words) for words in self._correction.range_warnings(temperature_c))
        monitor.set_sensor(rig, change_u_g, warnings)


def _unknown(time_s: float, why: Reason) -> MotionEstimate:
    return MotionEstimate(time_s=time_s, state="unknown", reasons=(why,))
