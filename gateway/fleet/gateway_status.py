"""The status of one gateway, judged from its latest messages: a pure function."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from math import inf
from typing import Literal

from gateway.messages import (
    SOURCES,
    ActiveAlert,
    Alert,
    Calibration,
    Condition,
    Health,
    Level,
    Motion,
    SessionPhase,
    Swing,
    Validity,
)
from gateway.messages.calibration import created_utc
from gateway.page.verdict import ALARMS, STYLES, PageEvidence, PageVerdict, Word, is_fresh, is_swing_known, verdict
from gateway.topics import KEY_PREFIX
from gateway.units import DAY_S

FleetWord = Literal["MISSING", "GONE", "DUPLICATE", "FAULT", "BATTERY LOW"] | Word
"""The words of the operator's page, and five that only a list of gateways needs."""
_LOSSES: tuple[FleetWord, ...] = ("GONE", "STALE", "NO DATA", "DUPLICATE", "MISSING")
STATE_LABELS: dict[FleetWord, str] = {
    **{word: STYLES[word].label for word in ALARMS},
    **{word: STYLES[word].label if word in STYLES else word for word in _LOSSES},
    **{word: style.label for word, style in STYLES.items() if word not in {*ALARMS, *_LOSSES, "OK"}},
    "FAULT": "FAULT",
    "BATTERY LOW": "BATTERY LOW",
    "OK": STYLES["OK"].label,
}
"""In the order of urgency, the labels that people read: alarms, what cannot be seen, what is not to be trusted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusCauses:
    """What the status of a gateway follows from, as codes, so that a page can say it in its own language; None: not known."""

    alerts: tuple[ActiveAlert, ...] = ()
    validity: Validity | None = None
    session: SessionPhase | None = None
    """Phase of the recalibration."""
    failed_gates: tuple[str, ...] = ()
    """Gates that a reading which cannot be trusted has not passed."""
    faulty_parts: tuple[str, ...] = ()
    limits_changed: bool = False
    """Limits of the alerts are not as they were at commissioning."""
    age_s: float | None = None
    """Age of the oldest message on which the state depends."""


def status_causes(evidence: PageEvidence) -> StatusCauses:
    """Return the codes in the last messages of a gateway."""
    alert, condition = evidence.get(Alert), evidence.get(Condition)
    calibration, health = evidence.get(Calibration), evidence.get(Health)
    return StatusCauses(
        alerts=() if alert is None else tuple(alert.active),
        validity=None if alert is None else alert.validity,
        session=None if calibration is None else calibration.session.phase,
        failed_gates=() if condition is None or condition.trusted else _failed(condition.gates),
        faulty_parts=() if health is None else tuple(health.standing_faults),
        limits_changed=health is not None and bool(health.changed_limits),
        age_s=max((evidence.age_s[topic] for topic in evidence.judged if topic in evidence.age_s), default=None),
    )


def _failed(gates: Mapping[str, bool]) -> tuple[str, ...]:
    return tuple(name for name, passed in gates.items() if not passed)


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingReading:
    """The swing of a gateway whose reading is sound."""

    swinging: bool
    phi_max_deg: float | None
    u_deg: float | None
    upper95_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayStatus:
    """The status of one gateway; None where it is not known."""

    key: str
    state: FleetWord
    reasons: tuple[str, ...]
    alive: bool = False
    level: Level = "unknown"
    swing: SwingReading | None = None
    """None where the reading is not sound."""
    motion: Motion | None = None
    """From which a page takes the angle that decides; None where the reading is not sound, or motions are not received."""
    last_alarm: Word | None = None
    """The alarm that stood when the gateway, or who it is, was lost; None: none, or it stands now."""
    battery_percent: float | None = None
    battery_v: float | None = None
    signal_dbm: float | None = None
    calibration: str | None = None
    calibration_id: str | None = None
    calibration_age_days: float | None = None
    software: str | None = None
    authenticated: bool = True
    """Its messages are signed with its key, and fresh, and nobody else sends under its name."""
    device: str | None = None
    boot_id: str | None = None
    faults: int | None = None
    page: str | None = None
    """Address of the operator's page, as the gateway states it."""
    seen_s: float | None = None
    """Time since the last message; None: none was seen."""
    causes: StatusCauses = field(default_factory=StatusCauses)

    @property
    def name(self) -> str:
        """Site, crane and sensor."""
        return self.key.removeprefix(KEY_PREFIX)

    @property
    def label(self) -> str:
        """The state as people read it, marked where what it says is not authenticated, and where no sensor takes the samples."""
        is_marked = not self.authenticated and self.state not in ("NOT AUTHENTICATED", "GONE")
        mark = STATE_LABELS["NOT AUTHENTICATED"] if is_marked else ""
        return " ".join(filter(None, (STATE_LABELS[self.state], mark, self.source)))

    @property
    def source(self) -> str:
        """SIMULATION or REPLAY; empty where a sensor takes the samples, or nothing is known."""
        return SOURCES.get(self.device or "", "")


def gateway_status(
    key: str, evidence: PageEvidence, seen_s: float | None, now_utc: datetime, *, duplicate: bool
) -> GatewayStatus:
    """Judge one gateway. `duplicate`: two gateways use this name at the same time."""
    # nobody is there to prove who it is
    judged = verdict(evidence if evidence.gateway else replace(evidence, doubt=None))
    alert, health, calibration = evidence.get(Alert), evidence.get(Health), evidence.get(Calibration)
    state: FleetWord = judged.word
    reasons = judged.reasons
    if not evidence.gateway:
        state = "GONE"
    elif duplicate:
        state, reasons = "DUPLICATE", ["two gateways use this name at the same time", *reasons]
    elif state == "OK" and health is not None and health.standing_faults:
        state, reasons = "FAULT", list(health.standing_faults.values())
    elif state == "OK" and health is not None and health.battery_low:
        state, reasons = "BATTERY LOW", ["the battery of the sensor is low"]
    if health is not None and health.changed_limits:
        reasons = [*reasons, *health.changed_limits]
    is_sound = judged.sound and evidence.gateway and not duplicate
    current = alert is not None and evidence.gateway and is_fresh(evidence, "alert")
    if alert is not None and evidence.doubt is not None and alert.level == "normal":
        current = False
    return GatewayStatus(
        key=key,
        state=state,
        reasons=tuple(reasons),
        alive=evidence.gateway,
        level=alert.level if alert is not None and current else "unknown",
        swing=_swing(evidence) if is_sound else None,
        motion=evidence.get(Motion) if is_sound and evidence.age_s.get("motion", inf) <= evidence.stale_s else None,
        last_alarm=None if state in ALARMS else _alarm(judged),
        battery_percent=None if health is None else health.battery_percent,
        battery_v=None if health is None else health.battery_v,
        signal_dbm=None if health is None else health.signal_dbm,
        calibration=None if calibration is None else calibration.status,
        calibration_id=None if calibration is None else calibration.calibration_id,
        calibration_age_days=None if calibration is None else _age_days(calibration, now_utc),
        software=None if health is None else health.software,
        authenticated=evidence.doubt is None,
        device=None if health is None else health.device_kind,
        boot_id=None if health is None else health.boot_id,
        faults=None if health is None else sum(health.faults.values()),
        page=None if health is None else health.page,
        seen_s=seen_s,
        causes=status_causes(evidence),
    )


def _alarm(judged: PageVerdict) -> Word | None:
    return next((word for word in (judged.word, *judged.also) if word in ALARMS), None)


def missing_gateway(key: str) -> GatewayStatus:
    """Return the status of an expected gateway that was never seen."""
    return GatewayStatus(key=key, state="MISSING", reasons=("expected, and never seen",))


def _swing(evidence: PageEvidence) -> SwingReading | None:
    swing = evidence.get(Swing)
    if swing is None or swing.swinging is None or not is_swing_known(swing):
        return None
    high = swing.coverage95_deg[1] if swing.coverage95_deg is not None else None
    return SwingReading(
        swinging=swing.swinging,
        phi_max_deg=swing.phi_max_deg if swing.swinging else None,
        u_deg=swing.u_deg if swing.swinging else None,
        upper95_deg=high,
    )


def _age_days(calibration: Calibration, now_utc: datetime) -> float | None:
    created = created_utc(calibration)
    return None if created is None else (now_utc - created).total_seconds() / DAY_S
