"""The time at which the calibration record in force was made."""

from datetime import UTC, datetime

from gateway.messages import Calibration


def created_utc(calibration: Calibration) -> datetime | None:
    """Return when the record in force was made; None where there is none, or it states no time."""
    try:
        created = datetime.fromisoformat(str(calibration.record.get("created_utc", "")))
    except ValueError:
        return None
    return created if created.tzinfo is not None else created.replace(tzinfo=UTC)
