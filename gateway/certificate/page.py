"""The certificate of a calibration record: one self-contained HTML page, one sheet of A4 when printed.

Fields of a record are text of unknown origin: the templates escape them, their length is bounded, and the page forbids itself
scripts and the network.
"""

from collections.abc import Sequence

import numpy as np

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.budget import combined_uncertainty, format_contribution, largest_contributions
from gateway.certificate.comparison import changes_since, differs_from_named
from gateway.certificate.correction import correction_rows, matrix_unit, sensitivities
from gateway.certificate.identity import identity_facts
from gateway.certificate.limits import limits
from gateway.certificate.method_figure import method_plot
from gateway.certificate.residual_plot import pose_residuals
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
        record=record,
        parent=parent,
        facts=identity_facts(record),
        warnings=[*warnings, *record.warnings],
        correction_rows=correction_rows(record),
        matrix_unit=matrix_unit(record),
        contributions=largest_contributions(record),
        combined_u=combined_uncertainty(record),
        format_contribution=format_contribution,
        residual=pose_residuals(record),
        method_plot=method_plot(record),
        changes=None if parent is None else changes_since(record, parent, earlier),
        limits=limits(record),
    )
