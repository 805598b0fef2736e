"""What a certificate must not be taken to say."""

from xml.etree.ElementTree import Element

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.element import element
from gateway.certificate.figures import significant

ALWAYS = (
    "It is no accredited certificate: the standard is gravity on site, taken as 1 g; nothing here is traceable beyond that.",
    "It holds for this device alone, at rest and within 1 g; nothing is said of bandwidth, vibration, shock or larger forces.",
    "The hash shows that the record was not changed since; it is no signature and does not prove who made it.",
)
BY_METHOD = {
    "six-position": "Residuals show faces that lie unlike each other; a table that is tilted as a whole goes into the matrix.",
    "norm-fit": "The axes are known against each other; how they lie in the housing is not: zero in place for that.",
    "zero": "Offset and mount angle were removed as a sum along the rope; scale and the other attitudes are the parent's.",
}
NO_TEMPERATURE = "The temperature was not recorded: how far the values hold in the cold or the heat is not known."


def limits(record: CalibrationRecord) -> Element:
    """The list."""
    known = record.temperature_c
    said = [*ALWAYS]
    if record.method in BY_METHOD:
        said.append(BY_METHOD[record.method])
    if known and record.thermal is None:
        low, high = significant(known.get("min")), significant(known.get("max"))
        said.append(f"Outside {low} to {high} °C the values were not measured and no thermal model corrects them.")
    elif not known:
        said.append(NO_TEMPERATURE)
    return element(
        "section",
        element("h2", "What this certificate does not say"),
        element("ul", *(element("li", text) for text in said)),
        class_="limits",
    )


def interval(record: CalibrationRecord) -> Element:
    """The figures that the condition check works by."""
    dm_mg = significant(1000 * float(record.prediction_interval_g))
    condition = significant(None if record.condition_number is None else float(record.condition_number))
    return element(
        "p",
        element("strong", f"Prediction interval dm = ± {dm_mg} mg"),
        f": a reading at rest farther from 1 g is not believed. Condition number of the poses {condition}.",
    )
