"""Limits of data sheets at 25 °C and over temperature, and the verdict on a measured axis.

The first four parts are those of Sawicki and Walendziuk 2016, Tables 1 to 6. Table 3 prints the zero-g limits of x and y of the
ADXL335 for its z axis too; Table 1 has the wider ones of the data sheet. Table 2 prints the sensitivity of the MPU-9255 as 16.384
LSB/g; it is 16384. Table 6 leaves out its limit of 1.5 mg/°C, which Table 2 has.
"""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["within", "exceeds", "undecided"]
Limits = tuple[float, float]


@dataclass(frozen=True, slots=True)
class DatasheetLimits:
    """Limits of a part; None: the data sheet states none."""

    part: str
    offset_mg_per_c: float | None
    """Largest change of the zero-g offset with temperature, mg/°C."""
    sensitivity_percent_per_c: float | None
    """Largest change of the sensitivity with temperature, %/°C."""
    unit: Literal["V", "counts"] | None = None
    """Unit of the limits below."""
    sensitivity: Limits | None = None
    """Smallest and largest sensitivity at 25 °C, per g."""
    zero_g: tuple[Limits, Limits, Limits] | None = None
    """Smallest and largest zero-g offset at 25 °C of x, y and z."""


LIMITS_BY_PART = {
    limits.part: limits
    for limits in (
        DatasheetLimits("ADXL335", 1.0, 0.010, "V", (0.270, 0.330), ((1.35, 1.65), (1.35, 1.65), (1.2, 1.8))),
        DatasheetLimits("ADXL327", 1.0, 0.010, "V", (0.378, 0.462), ((1.3, 1.7), (1.3, 1.7), (1.3, 1.7))),
        DatasheetLimits("LIS344ALH", 0.4, 0.010, "V", (0.570, 0.630), ((1.425, 1.575),) * 3),
        DatasheetLimits(
            "MPU-9255", 1.5, 0.026, "counts", None, ((-983.0, 983.0), (-983.0, 983.0), (-1311.0, 1311.0))
        ),  # 60 mg and 80 mg at 16384 LSB/g
        DatasheetLimits("ADXL355", 0.15, 0.01),
    )
}
"""Known parts by name, with the limits of their data sheets."""


def judge_interval(low: float, high: float, limits: Limits | None) -> Verdict | None:
    """Return whether a 95 % interval lies within two limits, outside of them, or on one; None without limits."""
    if limits is None:
        return None
    if limits[0] <= low and high <= limits[1]:
        return "within"
    return "exceeds" if high < limits[0] or low > limits[1] else "undecided"


def overall(verdicts: list[Verdict | None]) -> Verdict | None:
    """Return the worst of several verdicts; None where there is none."""
    given = [verdict for verdict in verdicts if verdict is not None]
    return next((verdict for verdict in ("exceeds", "undecided", "within") if verdict in given), None)
