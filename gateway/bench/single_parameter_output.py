"""The calibration record and the report of a single-parameter calibration."""

from typing import Any

import numpy as np

from gateway.bench.single_parameter import (
    RANGE_RAD,
    SingleParameterFit,
    approximation_error,
    relative_angle_u_rad,
)
from gateway.calibration.calibration_fit import CalibrationFit, FitWarning, prediction_interval_g
from gateway.calibration.record import SINGLE_PARAMETER, FigureSeries, RecordFigure
from gateway.numerics.array import Array

SCALE_LIMIT, CROSS_AXIS_LIMIT = 0.05, 0.02
"""Limits of scale factor and cross-axis sensitivity, which the method does not measure (Zhu et al. 2020, table 1)."""
FULL_RANGE = 0.9999
"""Share of the range at which the report states the uncertainty. Basis: rounding must not take the angle beyond it."""
PLAUSIBLE_A_G = 0.075
"""Largest plausible A_z,off, g: zero-g offset and scale factor of a data sheet together, 25 mg and 5 % (Zhu et al. 2020,
table 1)."""
NOT_MEASURED = "for relative angles within +-5 deg only: offsets of x and y and all scale factors are data-sheet limits"


def as_calibration(fit: SingleParameterFit) -> CalibrationFit:
    """Return the correction that gives the same relative angles near the level: an offset of z, everything else as it reads.

    Readings are in g. The z offset is exp(A_z,off) - 1, exact where eq. 10 is an approximation. What the method does not measure
    has the limits of data sheets as its uncertainty.
    """
    variance = np.full((3, 3), CROSS_AXIS_LIMIT**2 / 3)
    np.fill_diagonal(variance, SCALE_LIMIT**2 / 3)
    u_offset = fit.setup.u_zero_g_offset_g
    u_z_g = float(np.exp(fit.a_z_off_g)) * fit.u_g
    covariance = np.diag([*variance.ravel(), u_offset**2, u_offset**2, u_z_g**2])
    warnings = [FitWarning(NOT_MEASURED)]
    if abs(fit.a_z_off_g) > PLAUSIBLE_A_G:
        text = (
            f"A_z,off of {1000 * fit.a_z_off_g:.0f} mg is more than offset and scale of a data sheet "
            f"({1000 * PLAUSIBLE_A_G:.0f} mg): one number decides the scale, so measure the distance twice, and check that "
            "displacements are in mm and angles in degrees"
        )
        warnings.append(FitWarning(text, is_outlier=True))
    if fit.widened > 1:
        text = f"the pairs scatter {fit.widened:.1f} times as much as stated: the uncertainty is enlarged by that"
        warnings.append(FitWarning(text))
    return CalibrationFit(
        method=SINGLE_PARAMETER,
        offset=(0.0, 0.0, float(np.expm1(fit.a_z_off_g))),
        correction_matrix=np.eye(3),
        covariance=covariance,
        prediction_interval_g=prediction_interval_g(np.eye(3), covariance, 0.0),
        poses=(),
        temperature_c=None,
        misalignment_deg={},
        residual_rms_g=float(np.sqrt(np.mean((fit.pair_a_g - fit.a_z_off_g) ** 2))),
        condition_number=1.0,
        budget=tuple(
            {
                "source": part.source,
                "type": part.type,
                "u_g": part.u_g,
                "u_deg": float(np.degrees(part.u_g * RANGE_RAD)),
            }
            for part in fit.contributions
        ),
        warnings=tuple(warnings),
    )


def single_parameter_fields(fit: SingleParameterFit) -> dict[str, Any]:
    """Return the record's fields `single_parameter`, the numbers of the source, and `figure`."""
    pairs = zip(fit.pair_angle_rad.tolist(), fit.pair_a_g.tolist(), fit.pair_u_g.tolist(), strict=True)
    numbers = {
        "a_z_off_mg": 1000 * fit.a_z_off_g,
        "u_mg": 1000 * fit.u_g,
        "range_deg": float(np.degrees(RANGE_RAD)),
        "approximation_percent": 100 * approximation_error(fit.a_z_off_g),
        "distance_m": fit.setup.distance_m,
        "pairs": [
            {"angle_deg": float(np.degrees(angle)), "a_z_off_mg": 1000 * a_g, "u_eq21_mg": 1000 * u_g}
            for angle, a_g, u_g in pairs
        ],
    }
    return {"single_parameter": numbers, "figure": _figure(fit).model_dump(mode="json")}


def format_single_parameter(fit: SingleParameterFit, notes: tuple[str, ...]) -> str:
    """Return the report as several lines of text."""
    angle = np.array([RANGE_RAD]) * np.exp(-fit.a_z_off_g) * FULL_RANGE
    percent = 100 * float(relative_angle_u_rad(angle, fit, fit.setup.u_raw_angle_rad)[0] / angle[0])
    rows = zip(np.degrees(fit.pair_angle_rad), 1000 * fit.pair_a_g, 1000 * fit.pair_u_g, strict=True)
    return "\n".join(
        [
            f"{'pair':>4}  {'angle / deg':>11}  {'A_z,off / mg':>12}  {'u (eq. 21) / mg':>15}",
            *(
                f"{number:4}  {row[0]:11.4f}  {row[1]:12.2f}  {row[2]:15.2f}"
                for number, row in enumerate(rows, start=1)
            ),
            "",
            "standard uncertainty of A_z,off",
            *(f"  {part.type}  {part.source:36} {1000 * part.u_g:8.3f} mg" for part in fit.contributions),
            "",
            f"A_z,off = {1000 * fit.a_z_off_g:.2f} mg, u = {1000 * fit.u_g:.2f} mg",
            f"actual relative angle = {np.exp(fit.a_z_off_g):.6f} x raw relative angle, within +-5 deg (eq. 11)",
            f"relative standard uncertainty at 5 deg: {percent:.3f} % (eq. 20); approximation by exp, as figure 7: "
            f"{100 * approximation_error(fit.a_z_off_g):.3f} %",
            *(f"warning: {warning.text}" for warning in as_calibration(fit).warnings),
            *(f"note: {text}" for text in notes),
        ]
    )


def format_corrected(raw_rad: Array, corrected_rad: Array, u_rad: Array) -> str:
    """Return corrected relative angles as CSV."""
    rows = zip(*(np.degrees(values).tolist() for values in (raw_rad, corrected_rad, u_rad)), strict=True)
    return "\n".join(["raw_angle_deg,angle_deg,u_deg", *(f"{a:.6f},{b:.6f},{u:.6f}" for a, b, u in rows)]) + "\n"


def _figure(fit: SingleParameterFit) -> RecordFigure:
    mean_mg, u_mg = 1000 * fit.a_z_off_g, 1000 * fit.u_g
    return RecordFigure(
        title="A_z,off of each pair",
        x_label="relative angle of the beam / °",
        y_label="A_z,off / mg",
        series=(
            FigureSeries(
                name="pairs",
                x=tuple(np.degrees(fit.pair_angle_rad).tolist()),
                y=tuple((1000 * fit.pair_a_g).tolist()),
                u=tuple((1000 * fit.pair_u_g).tolist()),
            ),
        ),
        bounds=(mean_mg - 2 * u_mg, mean_mg + 2 * u_mg),
        caption=f"Bars: ± 2 u by eq. 21. Dashed: mean {mean_mg:.2f} mg ± {2 * u_mg:.2f} mg (k = 2), with what the pairs share.",
    )
