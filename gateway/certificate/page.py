"""The certificate of a calibration record: one self-contained HTML page, one sheet of A4 when printed.

Fields of a record are text of unknown origin: the templates escape them, their length is bounded, and the page forbids itself
scripts and the network.
"""

from collections.abc import Sequence

import numpy as np

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.budget import budget_view
from gateway.certificate.comparison import comparison_view, differs_from_named
from gateway.certificate.correction import correction_view, sensitivities
from gateway.certificate.identity import hash_text, identity_facts, warnings_view
from gateway.certificate.limits import limits
from gateway.certificate.method_figure import method_figure_view
from gateway.certificate.residual_plot import residual_view
from gateway.documents.environment import render
from gateway.documents.text import printable_text


def render_certificate(
    record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord] = ()
) -> str:
    """Return the page. `earlier` are older records of the device, for a forecast from more than two.

    Never raises for a record.
    """
    with np.errstate(all="ignore"):  # numbers of unknown origin may overflow: what is not finite is shown as a dash
        return _render(record, parent, earlier)


def _render(record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord]) -> str:
    warnings = differs_from_named(record, parent)
    if sensitivities(record) is None:
        warnings.append("the correction matrix is singular: this record must not be used")
    return render(
        "certificate.html.j2",
        title=printable_text(f"Calibration certificate {record.id}", 90),
        facts=identity_facts(record),
        sha256=hash_text(record),
        warnings=warnings_view(record, warnings),
        correction=correction_view(record),
        budget=budget_view(record),
        residual=residual_view(record),
        figure=method_figure_view(record),
        comparison=comparison_view(record, parent, earlier),
        limits=limits(record),
    )
