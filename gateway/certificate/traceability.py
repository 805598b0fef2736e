"""What a laboratory asks of a certificate: reference, environment, uncertainty and decision rule (ISO/IEC 17025:2017, 7.8)."""

from gateway import __version__
from gateway.calibration.record import CalibrationRecord
from gateway.documents.format import format_short

GRAVITY = "local gravity, taken as 1 g; not accredited, not traceable beyond that"
REFERENCE_BY_METHOD = {
    "rotation": "the angle of the rig, and local gravity, taken as 1 g; not accredited, not traceable beyond that",
    "single-parameter": "pitch of the dot board and distance to it, as stated; not accredited, not traceable beyond that",
    "zero": "the vertical, and the parent record",
}
UNCERTAINTY = "U = k u, k = 2, about 95 % (GUM 6)"
LENGTHS_AND_RECORDS = (
    "the lengths that are stated and the calibration records of both sensors; not traceable beyond that"
)
BOARD = "the pitch of the dot board, as stated; not traceable beyond that"
NO_STATEMENT = "No statement of conformity"
GUARDED = (
    "Within a limit only if the 95 % interval is, beyond only if none of it is (ILAC-G8:09/2019, guard band w = U)"
)
NOT_RECORDED = "not recorded"


def reference(method: str) -> str:
    """Return what the values of a method are compared with."""
    return REFERENCE_BY_METHOD.get(method, GRAVITY)


def temperatures(record: CalibrationRecord) -> str:
    """Return the mean temperature of a record and its range as text."""
    if not record.temperature_c:
        return NOT_RECORDED
    mean, low, high = (format_short(record.temperature_c.get(name)) for name in ("mean", "min", "max"))
    return f"{mean} °C ({low} to {high} °C)"


def decision_rule(record: CalibrationRecord) -> str:
    """Return the decision rule of a record: only ramps are judged by limits of a data sheet."""
    summary = (record.thermal or {}).get("summary") or ()
    judged = any(isinstance(entry, dict) and entry.get("verdict") is not None for entry in summary)
    return GUARDED if judged else NO_STATEMENT


def measurement_facts(compared_with: str, by: str, temperature: str = NOT_RECORDED) -> tuple[tuple[str, str], ...]:
    """Return what a measurement that makes no record states of itself, as names and values."""
    return (
        ("Reference", compared_with),
        ("By", by),
        ("Software", f"plumbline {__version__}"),
        ("Temperature", temperature),
        ("Uncertainty", UNCERTAINTY),
        ("Decision rule", NO_STATEMENT),
    )
