"""Analogue triaxial accelerometers whose output is a share of their supply, with the limits of their data sheets.

Figures at a supply of 3 V (Sawicki and Walendziuk 2016, Tables 1 to 3 and 6). The limits serve as plausibility checks only.
"""

from dataclasses import dataclass

Limits = tuple[float, float]

NOMINAL_SUPPLY_V = 3.0


@dataclass(frozen=True, slots=True)
class AnaloguePart:
    """An analogue accelerometer; its output at zero g is half of its supply."""

    name: str
    sensitivity_v_per_g: float
    full_scale_g: float
    sensitivity_limits_v_per_g: Limits
    zero_g_limits_v: tuple[Limits, Limits, Limits]
    """Of x, y and z."""
    zero_g_offset_g_per_k: float
    supply_limits_v: Limits
    """Of operation, by the data sheet."""
    scale_factor_per_k: float = 1e-4

    @property
    def zero_g_offset_g(self) -> float:
        """Largest zero-g offset of any axis."""
        largest_v = max(abs(limit - NOMINAL_SUPPLY_V / 2) for limits in self.zero_g_limits_v for limit in limits)
        return largest_v / self.sensitivity_v_per_g

    def possible_outputs_v(self) -> tuple[Limits, Limits, Limits]:
        """Return the smallest and largest output of x, y and z within full scale that the data sheet allows at 3 V."""
        swing_v = self.full_scale_g * self.sensitivity_limits_v_per_g[1]
        x, y, z = ((low - swing_v, high + swing_v) for low, high in self.zero_g_limits_v)
        return x, y, z


ADXL335 = AnaloguePart("ADXL335", 0.3, 3.0, (0.27, 0.33), ((1.35, 1.65), (1.35, 1.65), (1.2, 1.8)), 1e-3, (1.8, 3.6))
ADXL327 = AnaloguePart("ADXL327", 0.42, 2.0, (0.378, 0.462), ((1.3, 1.7),) * 3, 1e-3, (1.8, 3.6))
LIS344ALH = AnaloguePart("LIS344ALH", 0.6, 2.0, (0.57, 0.63), ((1.425, 1.575),) * 3, 0.4e-3, (2.4, 3.6))
ANALOGUE_PARTS = {part.name: part for part in (ADXL335, ADXL327, LIS344ALH)}
"""By name."""
