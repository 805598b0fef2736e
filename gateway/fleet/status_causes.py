"""What the status of a gateway follows from, as codes, so that a page can say it in its own language."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.messages import ActiveAlert, Alert, Calibration, Condition, Health, SessionPhase, Validity
from gateway.page.verdict import PageEvidence


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusCauses:
    """The codes in the last messages of a gateway; None where it is not known."""

    alerts: tuple[ActiveAlert, ...] = ()
    validity: Validity | None = None
    session: SessionPhase | None = None
    """Phase of the recalibration."""
    failed_gates: tuple[str, ...] = ()
    """Gates that a reading which cannot be trusted has not passed."""
    faulty_parts: tuple[str, ...] = ()
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
        age_s=max((evidence.age_s[topic] for topic in evidence.judged if topic in evidence.age_s), default=None),
    )


def _failed(gates: Mapping[str, bool]) -> tuple[str, ...]:
    return tuple(name for name, passed in gates.items() if not passed)
