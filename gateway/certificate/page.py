"""The certificate of a calibration record: one self-contained HTML page, one sheet of A4 when printed.

Fields of a record are text of unknown origin: the page is built as a tree that escapes them, their length is bounded, and the
page forbids itself scripts and the network.
"""

from collections.abc import Sequence

import numpy as np

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.budget import budget
from gateway.certificate.comparison import comparison, differs_from_named
from gateway.certificate.correction import correction, sensitivities
from gateway.certificate.element import element, short, written
from gateway.certificate.identity import identity, warnings
from gateway.certificate.limits import interval, limits
from gateway.certificate.plot import residual_section
from gateway.certificate.style import STYLE

POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def certificate(
    record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord] = ()
) -> str:
    """The page. `earlier` are older records of the device, for a forecast from more than two. Never raises for a record."""
    with np.errstate(all="ignore"):  # numbers of unknown origin may overflow: what is not finite is shown as a dash
        return _page(record, parent, earlier)


def _page(record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord]) -> str:
    said = differs_from_named(record, parent)
    if sensitivities(record) is None:
        said.append("the correction matrix is singular: this record must not be used")
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="viewport", content="width=device-width"),
        element("title", short(f"Calibration certificate {record.id}", 90)),
        element("style", STYLE),
    )
    body = element(
        "main",
        element("header", element("h1", "Calibration certificate"), element("span", "Plumbline")),
        identity(record),
        warnings(record, said),
        correction(record),
        interval(record),
        element("div", budget(record), residual_section(record), class_="side"),
        comparison(record, parent, earlier),
        limits(record),
        element("footer", "Made from the record alone; the record, not this page, is what the gateway works by."),
    )
    return written(element("html", head, element("body", body), lang="en"))
