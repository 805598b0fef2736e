"""The latest messages of one gateway, and the judgement of what they still say. Pure; time is an argument."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from pydantic import ValidationError

from gateway.bridge.plant_snapshot import STATED, UNHEARD, WITHOUT_SENSOR, PlantSnapshot, PlantState
from gateway.bus.alert_receiver import PATIENCE_S
from gateway.bus.authenticity import DOUBT_S, Doubt, newer_doubt
from gateway.bus.fleet_inbox import FleetArrival, FleetBatch
from gateway.gateway_state import GatewayPresence, is_overdue
from gateway.messages import Alert, Calibration, Health, Level, Message, Motion
from gateway.messages.calibration import created_utc
from gateway.messages.header import ReasonCode
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.numerics.stats import NORMAL_975
from gateway.topics import adapter
from gateway.units import DAY_S

READ_TOPICS = ("motion", "alert", "health", "calibration")
MAX_READING_AGE_S = 1.0
"""A reading that is older is not known any more. Basis: the default of `alerts.stale_s`; ten come in that time."""
HEALTH_PATIENCE_S = 2.0
"""Battery and source are not known when the next health message is overdue by this time. Basis: three are missing."""
HEARTBEATS = 65_536
"""Definition: the numbers of a register."""
WITHOUT_SAMPLES: ReasonCode = "no_samples"
ALARMS: tuple[Level, ...] = ("warn", "trip")
IDENTITY_FAULT = "identity"
"""The standing fault of a gateway that hears another one of its name."""


@dataclass(frozen=True, slots=True)
class _Reading:
    """The newest motion message and the time of its arrival, s."""

    motion: Motion
    at_s: float


class HeardMessages:
    """Takes what a gateway sends, and says at any time what is known. All methods are called from one thread at a time."""

    def __init__(self, key: str, *, demonstration: bool = False, allow_unsigned: bool = False) -> None:
        """`demonstration`: values of a simulated crane or a recording count as known, and `source` says what they are.

        `allow_unsigned`: messages of a gateway that has no key count as its own.
        """
        self.key = key
        self.invalid = 0
        """Number of payloads that are not a valid message of their topic."""
        self._demonstration, self._allow_unsigned = demonstration, allow_unsigned
        self._is_signed = False
        """Authentic messages have come: no other is taken any more."""
        self._doubt: tuple[Doubt, float] | None = None
        """The last doubt about a message, and when it came."""
        self._presence = GatewayPresence()
        self._linked = False
        self._reading: _Reading | None = None
        self._health: Health | None = None
        self._health_s = -math.inf
        self._calibration: Calibration | None = None
        self._heartbeat = 0

    def take(self, batch: FleetBatch, now_s: float, *, is_linked: bool) -> None:
        """Take what has come since the last call, and whether somebody is connected."""
        was_alive, self._presence.is_alive = self._presence.is_alive, batch.alive.get(self.key, self._presence.is_alive)
        if is_linked and not self._linked:
            self._presence.connected_s = now_s
        if not is_linked or (self._presence.is_alive and was_alive is False):
            self._calibration = None  # another one may have been made meanwhile
        self._linked = is_linked
        if (doubt := batch.doubts.get(self.key)) is not None:
            self._doubt = newer_doubt(self._doubt, *doubt)
        taken = [topic for topic in READ_TOPICS if self._take(topic, batch.arrivals.get((self.key, topic)))]
        if "motion" in taken and self._judge(now_s) is PlantState.FINE:
            self._heartbeat = (self._heartbeat + 1) % HEARTBEATS

    def _take(self, topic: str, arrival: FleetArrival | None) -> bool:
        """Take a message; return whether it says something new."""
        if arrival is None or not self._admit(arrival.doubt):
            return False
        try:
            message: Message = adapter(topic).validate_json(arrival.payload)
        except ValidationError:
            self.invalid += 1
            return False
        if arrival.live:
            self._presence.hear(message, arrival.at_s)
        match message:
            case Motion() if arrival.live:
                if not self._is_new(message):
                    return False
                self._reading = _Reading(message, arrival.at_s)
            case Health() if arrival.live or self._health is None:
                self._health = message
                self._health_s = arrival.at_s if arrival.live else self._health_s
            case Calibration() if arrival.live or self._calibration is None:
                self._calibration = message
            case _:
                return False
        return True

    def _admit(self, doubt: Doubt | None) -> bool:
        """Return whether a message counts as the gateway's own."""
        if doubt is None and not self._is_signed:  # what came before may have been forged
            self._is_signed = True
            self._presence.forget()
            self._reading = self._health = self._calibration = None
        return doubt is None or (self._allow_unsigned and not self._is_signed and doubt.kind == "unsigned")

    def _judge(self, now_s: float) -> PlantState:
        """Return the one word that decides whether the measured values are known."""
        stated = STATED[self._presence.judge(now_s, PATIENCE_S, is_linked=self._linked)]
        if stated is PlantState.LINK_GONE:
            return stated
        if stated is PlantState.GATEWAY_GONE:
            return self._doubted(now_s, stated if self._presence.was_there else PlantState.NO_DATA)
        health = self._current_health()
        if health is None:
            # a gateway whose sensor was never there sends its health alone
            has_had_time = self._presence.alert is None and is_overdue(now_s - self._presence.connected_s, PATIENCE_S)
            is_alone = has_had_time and self._health is not None
            return PlantState.STALE if is_alone else self._doubted(now_s, PlantState.NO_DATA)
        if IDENTITY_FAULT in health.standing_faults:
            return PlantState.DUPLICATE
        if stated is PlantState.FINE and not self._demonstration:
            stated = WITHOUT_SENSOR.get(_kind(self._presence.alert, health), stated)
        if stated in (PlantState.FINE, PlantState.NOT_KNOWN) and self._is_stale(now_s):
            return PlantState.STALE
        is_known = self._reading is not None and _known(self._reading.motion.angle_deg) is not None
        return PlantState.NOT_KNOWN if stated is PlantState.FINE and not is_known else stated

    def _doubted(self, now_s: float, unheard: PlantState) -> PlantState:
        """Return the state where nothing is heard that counts as the gateway's own."""
        is_doubted = self._doubt is not None and self._doubt[0].kind != "unproved" and now_s - self._doubt[1] <= DOUBT_S
        return PlantState.NOT_AUTHENTICATED if is_doubted else unheard

    def _is_new(self, motion: Motion) -> bool:
        """Return whether a motion has a new sample behind it: a gateway without samples repeats that it knows nothing."""
        is_repeated = self._reading is not None and motion.time_ns == self._reading.motion.time_ns
        return not is_repeated and WITHOUT_SAMPLES not in (motion.reason_codes or ())

    def _is_stale(self, now_s: float) -> bool:
        return self._reading is None or now_s - self._reading.at_s > MAX_READING_AGE_S

    def _current_health(self) -> Health | None:
        """Return the last health message; None where it is of another start than the alerts: its source may be another one."""
        alert = self._presence.alert
        if self._health is None or alert is None or alert.boot_id != self._health.boot_id:
            return None
        return self._health

    def snapshot(self, now_s: float, now_utc: datetime) -> PlantSnapshot:
        """Return what is known now."""
        state = self._judge(now_s)
        reading, alert = self._reading, self._presence.alert
        known: dict[str, Any] = {}
        if state not in UNHEARD:
            known |= self._stated(now_s, now_utc)
        if state is PlantState.FINE and reading is not None:
            known |= _measured(reading.motion)
        level = _level(alert, state)
        if alert is not None and level != "unknown":
            known["active_alerts"] = sum(each.level in ALARMS for each in alert.active)
        return PlantSnapshot(
            state=state,
            heartbeat=self._heartbeat,
            age_s=None if reading is None else max(0.0, now_s - reading.at_s),
            sample_time_ns=None if reading is None else reading.motion.time_ns,
            level=level,
            **known,
        )

    def _stated(self, now_s: float, now_utc: datetime) -> dict[str, Any]:
        """Return what a gateway that is heard says of itself."""
        alert, health, calibration = self._presence.alert, self._current_health(), self._calibration
        created = None if calibration is None else created_utc(calibration)
        known: dict[str, Any] = {
            "calibration_age_days": None if created is None else (now_utc - created).total_seconds() / DAY_S
        }
        if health is not None:
            kind = _kind(alert, health)
            known["source"] = kind if kind in WITHOUT_SENSOR else "sensor"
        if health is not None and not is_overdue(now_s - self._health_s, HEALTH_PATIENCE_S):
            known |= {"battery_percent": _known(health.battery_percent), "battery_v": _known(health.battery_v)}
        if alert is not None:
            known |= {"alert_number": alert.alert_number, "boot_id": alert.boot_id}
        return known


def _kind(alert: Alert | None, health: Health) -> str:
    """Return what takes the samples: a recording that is played states the kind of device that it was made with."""
    return "replay" if alert is not None and alert.clock == "replayed" else health.device_kind


def _level(alert: Alert | None, state: PlantState) -> Level:
    """Return the level: calm only where everything is known; an alarm also where the gateway cannot see its end."""
    if alert is None or state in (*UNHEARD, *WITHOUT_SENSOR.values()):
        return "unknown"
    return alert.level if state is PlantState.FINE or alert.level in ALARMS else "unknown"


def _measured(motion: Motion) -> dict[str, float | None]:
    peak = _expected_peak(motion)
    return {
        "angle_deg": motion.angle_deg,
        "angle_u95_deg": _half_width(motion.u_deg),
        "phi_max_deg": _known(motion.phi_max_deg),
        "phi_max_u95_deg": _half_width(motion.phi_max_u_deg),
        "peak_deg": None if peak is None else _known(math.degrees(peak.angle_rad)),
        "peak_u95_deg": None if peak is None else _half_width(math.degrees(peak.u_rad)),
        "time_to_peak_s": None if peak is None else _known(peak.in_s),
    }


def _expected_peak(motion: Motion) -> PeakEstimate | None:
    """Return the peak on which the gateway's alerts rest."""
    return MotionEstimate(
        time_s=0.0,
        state=motion.state,
        next_peak=_peak(motion.predicted_phi_max_deg, motion.predicted_u_deg, motion.time_to_peak_s),
        next_peak_if_coasting=_peak(motion.coasting_phi_max_deg, motion.coasting_u_deg, motion.coasting_time_to_peak_s),
    ).expected_peak


def _peak(angle_deg: float | None, u_deg: float | None, in_s: float | None) -> PeakEstimate | None:
    if angle_deg is None or u_deg is None or in_s is None:
        return None
    return PeakEstimate(angle_rad=math.radians(angle_deg), u_rad=math.radians(u_deg), in_s=in_s)


def _half_width(u: float | None) -> float | None:
    """Return half the width of the 95 % interval; None where it is not known."""
    return None if (known := _known(u)) is None else NORMAL_975 * known


def _known(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
