"""Results of the swing estimator, in radians, seconds and metres; what could not be computed is None, and `reasons` say why."""

from dataclasses import dataclass

DETECTION_SIGMA = 3.0
"""Standard uncertainties from which on a value differs from zero."""
MIN_HOIST_M_S = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingPeak:
    """The largest rope angle of one swing."""

    time_s: float
    phi_max_rad: float
    u_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FormulaAngles:
    """Angles by the four formulas of Łuczak et al. 2022 over one interval, in rad; None: outside the formula's domain."""

    arccos_min_az: float | None
    """Eq. 22."""
    arcsin_max_axy: float | None
    """Eq. 23."""
    arctan_max_axy_min_az: float | None
    """Eq. 24."""
    arccos_max_az: float | None
    """Eq. 25."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingEstimate:
    """The swing in one window of specific force."""

    from_s: float
    to_s: float
    """Interval for which `phi_max_rad` holds; the fit may have used more."""
    swinging: bool | None
    """False: no swing detected, and the angle lies below the upper end of `coverage95_rad`. None: not known."""
    phi_max_rad: float | None = None
    """Largest angle between rope and vertical."""
    u_rad: float | None = None
    """Standard uncertainty of `phi_max_rad`."""
    coverage95_rad: tuple[float, float] | None = None
    """Coverage interval of 95 %, never below 0."""
    minor_phi_max_rad: float | None = None
    """Semi-minor axis of the swing about the lean: 0 planar, equal to the major one circular."""
    azimuth_rad: float | None = None
    """Direction of the swing's major axis in the housing frame, from x to y, in (-pi/2, pi/2]."""
    lean_rad: float | None = None
    """Steady angle of the rope, as by a side pull; a zero-g offset reads the same."""
    lean_u_rad: float | None = None
    lean_azimuth_rad: float | None = None
    """Direction of the lean in the housing frame, from x to y."""
    period_s: float | None = None
    """Period of a small swing on this rope: 2 pi sqrt(L/g)."""
    length_m: float | None = None
    length_u_m: float | None = None
    damping_ratio: float | None = None
    """Viscous damping of a small swing."""
    drag: float | None = None
    """Coefficient d of a drag force per mass d |v| v/L; None: the decay does not show any."""
    friction_rad: float | None = None
    """Angle at which dry friction holds the rope; None: the decay does not show any."""
    hoists_s: tuple[tuple[float, float], ...] = ()
    """Intervals in which the rope's length significantly changed, in a recording."""
    swings: tuple[SwingPeak, ...] = ()
    """Maximum of every full swing, oldest first."""
    reduced_chi_square: float | None = None
    """Of the residual against sensor noise; 1 where the pendulum explains everything."""
    noise_g: tuple[float, float, float] | None = None
    """Sensor noise that the fit used, 1 sigma per sample."""
    reasons: tuple[str, ...] = ()
