"""The pipeline: one sample block in, the messages that follow from it out.

calibration -> low-pass -> static tilt -> swing -> condition -> alerts. The swing fit costs most: a runner makes it beside the
pipeline, and its answer counts from a sample time that does not depend on how long it took. So no alert waits for a fit, and
the same blocks give the same messages. No clock is read: live and replay are the same.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.messages import NO_SESSION, CalibrationSession, Condition
from gateway.packing import pack
from gateway.pipeline import compose
from gateway.pipeline.alert_manager import AlertChange, AlertManager
from gateway.pipeline.clock_state import ClockState
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.pipeline.executor import Executor, ImmediateExecutor
from gateway.pipeline.header import Header, HeaderMaker
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.pipeline.rate_limiter import RateLimiter
from gateway.pipeline.swing_stage import SwingStage
from gateway.stages.clipping import count_clipped
from gateway.stages.conditions.monitor import ConditionMonitor, ConditionResult
from gateway.stages.lowpass import LowPass
from gateway.stages.tilt import axial_tilt, axial_tilt_uncertainty

LONGEST_BRIDGE_S = 0.05
"""A gap longer than this restarts the low-pass: bridging it would invent data."""
NOT_JUDGED = ConditionResult("unknown", None, False, ("no reading yet",), {}, None)


class Pipeline:
    """The stages of one device under one calibration."""

    def __init__(
        self,
        configuration: Configuration,
        info: DeviceInfo,
        correction: Correction,
        headers: HeaderMaker,
        runner: Executor | None = None,
        rest: DriftMonitor | None = None,
    ) -> None:
        """`runner` makes the swing fits; without one they are made at once. `rest` watches the drift of the record."""
        self._info = info
        self._full_scale = None if info.full_scale_g is None else info.full_scale_g * info.units_per_g
        self._correction = correction
        self._headers = headers
        self._stale_ns = round(configuration.alerts.stale_s * 1e9)
        self._lowpass = LowPass(configuration.filter.cutoff_hz, configuration.filter.order, info.odr_hz)
        self._delay_s = self._lowpass.delay_s()
        self._swing = SwingStage(configuration, info, correction, self._lowpass, runner or ImmediateExecutor())
        self._watch = ConditionMonitor(info.noise_g, correction.permissible_norm_error_g)
        self._board = AlertManager(configuration.alerts)
        self._rest = rest or DriftMonitor(None)
        self._condition = NOT_JUDGED
        self._tilt_pace, self._condition_pace = RateLimiter(0.1), RateLimiter(0.5)
        self._heartbeat_pace, self._calibration_pace = RateLimiter(1.0), RateLimiter(10.0)
        self._origin_ns: int | None = None
        self._newest_ns: int | None = None
        self._lowpassed_g: NDArray[np.float64] | None = None
        self._temperature_c: float | None = None
        """The newest known: a part may tell it less often than its samples."""
        self._session = NO_SESSION
        self._suspended: str | None = None

    def recalibrating(self, session: CalibrationSession, suspended: str | None) -> None:
        """How a recalibration stands; `suspended` says why nothing may be said of the load meanwhile, None: it may."""
        self._session = session
        self._suspended = suspended

    def process(self, block: SampleBlock, clock: ClockState) -> Iterator[OutgoingMessage]:
        """Everything that follows from a block; to be consumed wholly before the next."""
        newest_ns = int(block.time_ns[-1])
        yield OutgoingMessage("samples", newest_ns, pack(block, **self._header("samples", newest_ns, clock)))
        if self._calibration_pace.is_due(newest_ns):
            yield self.calibration(newest_ns, clock)
        force_g, lowpassed_g = self._filter(block)
        if self._suspended is not None:
            yield from self._without_load(self._suspended, block.temperature_c, newest_ns, clock)
            return
        time_s = self._time_s(block)
        self._watch.update(time_s, force_g, count_clipped(block.raw, self._full_scale), block.lost + block.invalid)
        if self._tilt_pace.is_due(newest_ns):
            yield self._tilt(block.temperature_c, newest_ns, clock)
        if self._swing.take(time_s, force_g, lowpassed_g, self._temperature_c):
            message = self._swing.message(self._header("swing", newest_ns, clock))
            yield OutgoingMessage("swing", newest_ns, message)
        yield from self._judge_condition(block.temperature_c, newest_ns, clock)
        yield from self._judge_alerts(newest_ns, clock)

    def idle(self, now_ns: int, clock: ClockState) -> Iterator[OutgoingMessage]:
        """No block has come for a while; `now_ns` is gateway time. Says so once the reading is stale."""
        silent_ns = 0 if self._newest_ns is None else now_ns - self._newest_ns
        if self._newest_ns is not None and silent_ns < self._stale_ns:
            return
        why = "no sample yet" if self._newest_ns is None else "stale: no samples are coming"
        if self._suspended is not None:
            why = f"{self._suspended}; {why}"
        first = self._condition.reasons != (why,)
        self._condition = ConditionResult("unknown", None, False, (why,), {"fresh": False}, None)
        if self._condition_pace.is_due(now_ns) or first:
            yield OutgoingMessage("condition", now_ns, self._condition_now(now_ns, clock))
        yield from self._hold({"swing": None, "lean": None}, why, now_ns, clock)

    def calibration(self, time_ns: int, clock: ClockState) -> OutgoingMessage:
        """Which calibration is in force, and how a recalibration stands."""
        header = self._header("calibration", time_ns, clock)
        message = compose.calibration_message(header, self._correction, self._info, self._session)
        return OutgoingMessage("calibration", time_ns, message)

    def _without_load(
        self, why: str, temperature_c: float | None, time_ns: int, clock: ClockState
    ) -> Iterator[OutgoingMessage]:
        """The housing does not hang on the rope: what is measured says nothing of the load."""
        first = self._condition.reasons != (why,)
        self._condition = ConditionResult("unknown", None, False, (why,), {"on_rope": False}, None)
        if self._tilt_pace.is_due(time_ns):
            yield self._tilt(temperature_c, time_ns, clock)
        if self._condition_pace.is_due(time_ns) or first:
            yield OutgoingMessage("condition", time_ns, self._condition_now(time_ns, clock))
        heartbeat = self._heartbeat_pace.is_due(time_ns)
        if heartbeat or first:
            yield OutgoingMessage(
                "swing", time_ns, compose.no_swing_message(self._header("swing", time_ns, clock), why)
            )
        changes = list(self._board.suspend(why, time_ns / 1e9))
        if heartbeat and not changes:
            changes = [self._board.heartbeat()]
        for change in changes:
            yield OutgoingMessage(
                "alert", time_ns, compose.alert_message(self._header("alert", time_ns, clock), change)
            )

    def _filter(self, block: SampleBlock) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Specific force in the housing frame, as it is and low-passed."""
        force_g = self._correction.apply(block.raw)
        if block.temperature_c is not None:
            self._temperature_c = block.temperature_c
        if self._newest_ns is not None and int(block.time_ns[0]) - self._newest_ns > LONGEST_BRIDGE_S * 1e9:
            self._lowpass.restart()
        lowpassed_g = self._lowpass.apply(force_g)
        self._lowpassed_g, self._newest_ns = lowpassed_g[-1], int(block.time_ns[-1])
        return force_g, lowpassed_g

    def _time_s(self, block: SampleBlock) -> NDArray[np.float64]:
        """Seconds since the first sample: small numbers keep their nanoseconds."""
        if self._origin_ns is None:
            self._origin_ns = int(block.time_ns[0])
        return np.asarray((block.time_ns - self._origin_ns) * 1e-9, dtype=np.float64)

    def _tilt(self, temperature_c: float | None, time_ns: int, clock: ClockState) -> OutgoingMessage:
        trusted = self._condition.verdict in ("static", "quasi_static")
        message = compose.tilt_message(
            self._header("tilt", time_ns, clock),
            self._lowpassed(),
            self._correction.u_force_g(self._lowpassed(), self._temperature_c),
            self._delay_s,
            temperature_c,
            trusted,
        )
        return OutgoingMessage("tilt", time_ns, message)

    def _judge_condition(
        self, temperature_c: float | None, time_ns: int, clock: ClockState
    ) -> Iterator[OutgoingMessage]:
        """At its pace; sent at once when the verdict changed. What is judged to be rest is for the drift watch too."""
        if not self._condition_pace.is_due(time_ns) and "fresh" not in self._condition.gates:
            return
        self._condition = self._watch.judge(self._swing.condition_context())
        self._rest.take(self._condition.gates, time_ns + clock.wall_offset_ns, self._lowpassed(), temperature_c)
        yield OutgoingMessage("condition", time_ns, self._condition_now(time_ns, clock))

    def _condition_now(self, time_ns: int, clock: ClockState) -> Condition:
        return compose.condition_message(self._header("condition", time_ns, clock), self._condition, self._correction)

    def _judge_alerts(self, time_ns: int, clock: ClockState) -> Iterator[OutgoingMessage]:
        """Hold the upper ends of the intervals against the limits."""
        swing_rad, lean_rad = self._swing.upper_confidence_limits()
        why = "; ".join(self._swing.why_unknown or self._condition.reasons)
        if lean_rad is None and self._condition.verdict in ("static", "quasi_static"):
            lowpassed_g = self._lowpassed()
            u_rad = axial_tilt_uncertainty(lowpassed_g, self._correction.u_force_g(lowpassed_g, self._temperature_c))
            lean_rad = float(axial_tilt(lowpassed_g)) + 2 * u_rad
        if self._correction.status == "uncalibrated":
            lean_rad, why = None, f"{why}; the sensor is not calibrated"
        yield from self._hold({"swing": swing_rad, "lean": lean_rad}, why, time_ns, clock)

    def _hold(
        self, values_rad: dict[str, float | None], why: str, time_ns: int, clock: ClockState
    ) -> Iterator[OutgoingMessage]:
        changes: list[AlertChange] = list(
            self._board.judge(
                values_rad,
                trusted=self._condition.trusted,
                why_unknown=why,
                time_s=time_ns / 1e9,
                drifted=self._rest.alarm,
            )
        )
        if self._heartbeat_pace.is_due(time_ns) and not changes:
            changes = [self._board.heartbeat()]
        for change in changes:
            yield OutgoingMessage(
                "alert", time_ns, compose.alert_message(self._header("alert", time_ns, clock), change)
            )

    def _lowpassed(self) -> NDArray[np.float64]:
        if self._lowpassed_g is None:
            raise ValueError("no block has been processed yet")
        return self._lowpassed_g

    def _header(self, topic: str, time_ns: int, clock: ClockState) -> Header:
        return self._headers.make(topic, time_ns, clock, self._correction.calibration_id)
