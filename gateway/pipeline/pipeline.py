"""The pipeline: one sample block in, the messages that follow from it out.

Calibration, low-pass filter, static tilt, motion, swing, condition, alerts. Each block is packed at once; everything else is
computed ten times a second, on a fixed grid of sample time, for all blocks since the last time, because Python's cost is per
call. The same blocks give the same messages. No clock is read, so a live run and a replay are the same.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.errors import InputError
from gateway.messages import NO_SESSION, CalibrationSession, CalibrationStatus, Message
from gateway.messages.header import Reason
from gateway.packing import pack
from gateway.pipeline import compose
from gateway.pipeline.alert_manager import AlertChange, AlertManager, ValidityMonitor
from gateway.pipeline.alert_rules import ALERT_RULES, Evaluation, swing_reading
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.pipeline.force_stage import ForceBatch, ForceStage, find_clipped, split_long_block
from gateway.pipeline.incidents import Acknowledgement, IncidentRegister
from gateway.pipeline.motion_stage import MotionStage, condition_text, housing_rates
from gateway.pipeline.outgoing_message import (
    ClockState,
    Header,
    HeaderMaker,
    MessageTime,
    OutgoingMessage,
    PipelineOutput,
    RateLimiter,
)
from gateway.stages.alerts import Reading
from gateway.stages.condition import ConditionResult, judge_condition
from gateway.stages.condition_window import ConditionWindow
from gateway.stages.lowpass import LowPass
from gateway.stages.tilt import axial_tilt, axial_tilt_uncertainty

UPDATE_PERIOD_S, CONDITION_PERIOD_S, HEARTBEAT_PERIOD_S, CALIBRATION_PERIOD_S = 0.1, 0.5, 1.0, 10.0
"""The period of the updates, with a tilt message each, divides the others. Basis: a choice; the tilt moves smoothly before the
eye, conditions change with the seconds of their window, and a calibration seldom."""
ACCELERATION_PERIOD_S = 0.2
"""Basis: a choice; for a display alone, the recording has the samples."""
AT_REST = ("static", "quasi_static")
"""The verdicts at which the static tilt is that of the rope."""
NOT_JUDGED = ConditionResult("unknown", None, False, (Reason("no_reading", "no reading yet"),), {}, None)


class Pipeline:
    """The stages of one device under one calibration."""

    def __init__(
        self,
        configuration: Configuration,
        info: DeviceInfo,
        correction: Correction,
        headers: HeaderMaker,
        drift: DriftMonitor | None = None,
        incidents: IncidentRegister | None = None,
    ) -> None:
        """`drift` monitors the calibration record; `incidents` numbers those of a boot and the changes of alerts."""
        self._info = info
        self._full_scale = None if info.full_scale_g is None else info.full_scale_g * info.units_per_g
        self._axes = configuration.device.axes
        self._correction = correction
        self._headers = headers
        self._stale_ns = round(configuration.alerts.stale_s * 1e9)
        cutoff_hz = configuration.filter.cutoff_hz
        if cutoff_hz >= info.odr_hz / 2:
            raise InputError(
                f"{info.kind}: {info.odr_hz:.3g} samples per second are too few for filter.cutoff_hz = {cutoff_hz:g}; "
                "take a faster sensor or a lower cut-off, and check whether the times of a replayed table are in seconds"
            )
        lowpass = LowPass(cutoff_hz, configuration.filter.order, info.odr_hz)
        self._delay_s = lowpass.delay_s()
        self._forces = ForceStage(correction, lowpass)
        self._motion = MotionStage(configuration, info, correction)
        self._condition_window = ConditionWindow()
        self._incidents = incidents or IncidentRegister()
        self._alerts = AlertManager(configuration.alerts, self._incidents)
        self._validity = ValidityMonitor()
        self._drift = drift or DriftMonitor(None)
        self._condition = NOT_JUDGED
        self._update_limiter = RateLimiter(UPDATE_PERIOD_S)
        self._condition_limiter = RateLimiter(CONDITION_PERIOD_S)
        self._heartbeat_limiter = RateLimiter(HEARTBEAT_PERIOD_S)
        self._calibration_limiter = RateLimiter(CALIBRATION_PERIOD_S)
        self._acceleration_limiter = RateLimiter(ACCELERATION_PERIOD_S)
        self._recent_g: list[NDArray[np.float64]] = []
        """Specific force since the last acceleration message."""
        self._lowpassed_g: NDArray[np.float64] | None = None
        self._temperature_c: float | None = None
        """The newest known temperature: a sensor may report it less often than its samples."""
        self._session = NO_SESSION

    def set_session(self, session: CalibrationSession) -> None:
        """Set the state of a recalibration."""
        self._session = session

    def process(self, block: SampleBlock, clock: ClockState) -> PipelineOutput:
        """Return everything that follows from a block."""
        return self._output(self._process(block, clock))

    def idle(self, now_ns: int, clock: ClockState) -> PipelineOutput:
        """Return what follows from the absence of blocks, once the reading is stale. `now_ns` is gateway time."""
        return self._output(self._idle(MessageTime(now_ns, clock)))

    def acknowledge(self, acknowledgement: Acknowledgement, now: MessageTime) -> list[OutgoingMessage]:
        """Return the change by which a person acknowledges an incident; nothing where that changes nothing."""
        change = self._alerts.acknowledge(acknowledgement, now.log_time_ns)
        return [] if change is None else list(self._alert_messages([change], heartbeat=False, now=now))

    def calibration_message(self, now: MessageTime) -> OutgoingMessage:
        """Return the calibration in force and the state of a recalibration."""
        return self._message(
            "calibration",
            now,
            lambda header: compose.calibration_message(header, self._correction, self._info, self._session),
        )

    def _output(self, messages: Iterator[OutgoingMessage]) -> PipelineOutput:
        made = list(messages)
        judged = any(message.topic == "condition" for message in made)
        return PipelineOutput(made, self._condition.verdict if judged else None)

    def _process(self, block: SampleBlock, clock: ClockState) -> Iterator[OutgoingMessage]:
        *early, last = split_long_block(block, UPDATE_PERIOD_S)
        for part in early:
            yield from self._add(part, MessageTime(int(part.time_ns[-1]), clock))
        now = MessageTime(int(block.time_ns[-1]), clock)
        yield self._message("samples", now, lambda header: pack(block, **header))
        if self._calibration_limiter.is_due(now.log_time_ns):
            yield self.calibration_message(now)
        yield from self._add(last, now)

    def _add(self, block: SampleBlock, now: MessageTime) -> Iterator[OutgoingMessage]:
        """Add samples, and return what follows from them when an update is due."""
        self._forces.push(block)
        if block.temperature_c is not None:
            self._temperature_c = block.temperature_c
        due = self._update_limiter.is_due(now.log_time_ns)
        if (why := self._session.suspension) is not None:
            batch = self._forces.take()
            self._lowpassed_g = batch.lowpassed_g[-1]
            yield from self._acceleration(batch, now)
            yield from self._without_load(Reason("off_rope", why), due, now)
        elif due or "fresh" in self._condition.gates:  # stale readings are judged again at once
            yield from self._update(self._forces.take(), due, now)

    def _update(self, batch: ForceBatch, tilt_due: bool, now: MessageTime) -> Iterator[OutgoingMessage]:
        """Return what follows from all samples since the last update."""
        self._lowpassed_g = batch.lowpassed_g[-1]
        yield from self._acceleration(batch, now)
        swing_due = self._add_to_windows(batch)
        if tilt_due:
            yield self._tilt(now)
            yield self._message("motion", now, self._motion.motion_message)
        if swing_due:
            yield self._message("swing", now, self._motion.swing_message)
        yield from self._judge_condition(now)
        yield from self._judge_alerts(now)

    def _add_to_windows(self, batch: ForceBatch) -> bool:
        """Add the samples to condition window and motion; return whether a message of the swing is due."""
        clipped = [find_clipped(block.raw, block.saturated, self._full_scale) for block in batch.blocks]
        rates = housing_rates(batch.blocks, self._info.gyro_rad_s_per_count, self._axes)
        turning = self._motion.without_gyro_bias(rates)
        for (block, part), is_clipped in zip(batch.slices(), clipped, strict=True):
            missing = block.lost + block.invalid
            n_clipped, rate = int(np.count_nonzero(is_clipped)), None if turning is None else turning[part]
            self._condition_window.update(batch.time_s[part], batch.force_g[part], n_clipped, missing, rate)
        return self._motion.update(
            batch.time_s, batch.force_g, batch.lowpassed_g, np.concatenate(clipped), self._temperature_c, rates
        )

    def _idle(self, now: MessageTime) -> Iterator[OutgoingMessage]:
        newest_ns = self._forces.newest_ns
        if newest_ns is not None and now.log_time_ns - newest_ns < self._stale_ns:
            return
        words = "no sample yet" if newest_ns is None else "stale: no samples are coming"
        if (suspended := self._session.suspension) is not None:
            words = f"{suspended}; {words}"
        why = Reason("no_samples", words)
        changed = self._set_unknown(why, {"fresh": False})
        self._motion.set_unknown(why)
        if self._condition_limiter.is_due(now.log_time_ns) or changed:
            yield self._message("motion", now, self._motion.motion_message)
            yield self._condition_message(now)
        yield from self._apply_limits({}, why, now)

    def _without_load(self, why: Reason, tilt_due: bool, now: MessageTime) -> Iterator[OutgoingMessage]:
        """Return the messages while the housing is off the rope, when no reading describes the load."""
        changed = self._set_unknown(why, {"on_rope": False})
        self._motion.restart(why)
        if tilt_due:
            yield self._tilt(now)
            yield self._message("motion", now, self._motion.motion_message)
        if self._condition_limiter.is_due(now.log_time_ns) or changed:
            yield self._condition_message(now)
        heartbeat = self._heartbeat_limiter.is_due(now.log_time_ns)
        if heartbeat or changed:
            yield self._message("swing", now, self._motion.swing_message)
        changes = list(self._alerts.suspend(why, now.log_time_ns / 1e9))
        yield from self._alert_messages(changes, heartbeat, now)

    def _set_unknown(self, why: Reason, gates: dict[str, bool]) -> bool:
        """Make the condition unknown; return whether the reason is a new one."""
        changed = self._condition.reasons != (why,)
        self._condition = ConditionResult("unknown", None, False, (why,), gates, None)
        return changed

    def _acceleration(self, batch: ForceBatch, now: MessageTime) -> Iterator[OutgoingMessage]:
        """Return the specific force since the message before, at its rate."""
        self._recent_g.append(batch.force_g)
        if not self._acceleration_limiter.is_due(now.log_time_ns):
            return
        force_g, self._recent_g = np.concatenate(self._recent_g), []
        u_force_g = self._correction.u_force_g(batch.lowpassed_g[-1], self._temperature_c)
        yield self._message(
            "acceleration", now, lambda header: compose.acceleration_message(header, force_g, u_force_g)
        )

    def _tilt(self, now: MessageTime) -> OutgoingMessage:
        trusted = self._condition.verdict in AT_REST
        lowpassed_g, u_force_g = self._lowpassed()
        return self._message(
            "tilt",
            now,
            lambda header: compose.tilt_message(
                header, lowpassed_g, u_force_g, self._delay_s, self._temperature_c, trusted
            ),
        )

    def _judge_condition(self, now: MessageTime) -> Iterator[OutgoingMessage]:
        """Judge the condition at its rate, or at once after stale readings; readings at rest also go to the drift monitor."""
        if not self._condition_limiter.is_due(now.log_time_ns) and "fresh" not in self._condition.gates:
            return
        self._condition = judge_condition(
            self._condition_window,
            self._motion.condition_context(),
            self._info.noise_g,
            self._correction.permissible_norm_error_g,
        )
        self._drift.update(self._condition.gates, now.utc_ns, self._lowpassed()[0], self._temperature_c)
        yield self._condition_message(now)

    def _condition_message(self, now: MessageTime) -> OutgoingMessage:
        text = condition_text(self._condition, self._motion.estimate)
        return self._message(
            "condition",
            now,
            lambda header: compose.condition_message(header, self._condition, self._correction, text),
        )

    def _judge_alerts(self, now: MessageTime) -> Iterator[OutgoingMessage]:
        """Compare the upper confidence limits with the alert limits."""
        why = "; ".join(self._motion.estimate.reasons or self._condition.reasons)
        if self._correction.status == "uncalibrated":
            why = f"{why}; the sensor is not calibrated"
        tilt = None
        if self._condition.verdict in AT_REST:
            lowpassed_g, u_force_g = self._lowpassed()
            tilt = Reading.of(axial_tilt(lowpassed_g), axial_tilt_uncertainty(lowpassed_g, u_force_g))
        evaluation = Evaluation(self._motion.estimate, tilt, self._correction.status != "uncalibrated")
        yield from self._apply_limits({rule.name: rule.reading(evaluation) for rule in ALERT_RULES}, why, now)

    def _apply_limits(
        self, readings: Mapping[str, Reading | None], why: str, now: MessageTime
    ) -> Iterator[OutgoingMessage]:
        changes = list(
            self._alerts.judge(
                readings,
                why_unknown=why,
                time_s=now.log_time_ns / 1e9,
                drift_alarm=self._drift.alarm,
                is_untrusted=not self._condition.trusted,
            )
        )
        yield from self._alert_messages(changes, self._heartbeat_limiter.is_due(now.log_time_ns), now)

    def _alert_messages(
        self, changes: list[AlertChange], heartbeat: bool, now: MessageTime
    ) -> Iterator[OutgoingMessage]:
        """Return a message for each change, or the heartbeat when it is due and nothing has changed."""
        urgent = self._validity.update(self._condition, self._correction.status, swing_reading(self._motion.estimate))
        if (heartbeat or urgent) and not changes:
            changes = [self._alerts.heartbeat()]
        for change in changes:
            self._incidents.number_change(change.rule)
            make = partial(
                compose.alert_message, change=change, incidents=self._incidents, validity=self._validity.present
            )
            yield self._message("alert", now, make)

    def _lowpassed(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the newest low-passed reading and the uncertainty of its axes."""
        if self._lowpassed_g is None:
            raise ValueError("no block has been processed yet")
        return self._lowpassed_g, self._correction.u_force_g(self._lowpassed_g, self._temperature_c)

    def _message(self, topic: str, now: MessageTime, make: Callable[[Header], Message]) -> OutgoingMessage:
        """Return the message of a topic that is made of its header."""
        header = self._headers.make(topic, now, self._correction.calibration_id)
        return OutgoingMessage(topic, now.log_time_ns, make(header))


class PipelineCalibration(NamedTuple):
    """What a pipeline was made for: the calibration in force, and whether a recalibration suspends the alerts.

    When any of it changes, another pipeline begins.
    """

    calibration_id: str | None
    status: CalibrationStatus
    suspended: bool
