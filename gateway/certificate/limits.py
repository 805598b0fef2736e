"""Limits of a certificate: what it must not be taken to say."""

from gateway.calibration.record import CalibrationRecord
from gateway.documents.format import format_short

ALWAYS = (
    "This is not an accredited certificate: the reference is local gravity, taken as 1 g, and nothing here is traceable "
    "beyond that.",
    "It holds for this device only, at rest and within 1 g. It does not cover bandwidth, vibration, shock or larger forces.",
    "The hash shows that the record is unchanged. It is no signature and does not prove who made the record.",
)
BY_METHOD = {
    "six-position": "The residuals show inconsistent faces; the matrix absorbs a tilt of the whole table.",
    "norm-fit": "The fit determines the axes relative to each other, not relative to the housing: zeroing in place does that.",
    "rotation": "The rig's angle is taken as true: a periodic error of the rig appears as an error of the sensor.",
    "thermal": "The ramps measure the sensor in its housing; a mount or a rope that bends with temperature is not in the model.",
    "thermal-rest": "Only the axis along the rope was measured over temperature, offset and scale as a sum.",
    "single-parameter": "Only relative angles within 5° of the level were calibrated; absolute tilt and magnitude were not.",
    "zero": "Zeroing removes offset and mount angle together, along the rope; scale and other attitudes are the parent's.",
}
NO_TEMPERATURE = "The temperature was not recorded, so it is not known how far the values hold in cold or heat."


def limits(record: CalibrationRecord) -> tuple[str, ...]:
    """Return the sentences that apply to a record."""
    known = record.temperature_c
    sentences = [*ALWAYS]
    if record.method in BY_METHOD:
        sentences.append(BY_METHOD[record.method])
    if known and record.thermal is None:
        low, high = format_short(known.get("min")), format_short(known.get("max"))
        sentences.append(
            f"Outside {low} to {high} °C the values were not measured, and no thermal model corrects them."
        )
    elif not known:
        sentences.append(NO_TEMPERATURE)
    return tuple(sentences)
