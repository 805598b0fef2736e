"""Single-parameter calibration of relative angles from the displacement of a laser spot (Zhu et al. 2020, eq. 9 to 13, 19 to 21).

Within a few degrees of the level, an inclinometer's relative angle is wrong by a factor, exp(-A_z,off / 1 g), which the zero-g
offset of the z axis dominates and scale-factor errors join. The factor is measured against the angle of a laser beam on the same
platform, atan(d / L), and so includes all of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.record import NotDeterminedError
from gateway.errors import InputError
from gateway.numerics.array import Array
from gateway.numerics.stats import CHANCE_LEVEL, chi_square_quantile

RANGE_RAD = np.radians(5.0)
"""Largest relative angle for which the method holds (Zhu et al. 2020, sec. 2.2)."""
MAX_A_G = 0.3
"""Largest A_z,off of any sensor, g. Basis: a choice; above zero-g offset and sensitivity of the widest data sheets, 150 mg and
10 %."""
SHARED_ZERO = 0.5
"""Correlation of the pairs of one session. Basis: half of each pair's variance is that of the zero which all of them refer to."""
APPROXIMATION_STEPS = 500
"""Steps of the angle at which the approximation is judged. Basis: a choice; a hundredth of a degree of 5 degrees."""


@dataclass(frozen=True, slots=True)
class DisplacementPairs:
    """Pairs of laser displacement and raw relative angle, each counted from the zero of its session; n pairs."""

    displacement_m: Array
    """Shape (n,), signed as the angle."""
    u_displacement_m: Array
    """Standard uncertainty, shape (n,)."""
    raw_angle_rad: Array
    """Relative angle as the inclinometer reads it, shape (n,)."""
    session: NDArray[np.int64]
    """Number of the session whose first photograph and first angle are the zero, shape (n,)."""


@dataclass(frozen=True, slots=True)
class LaserSetup:
    """Distance and standard uncertainties of the setup."""

    distance_m: float
    """From the rotation axis to the board."""
    u_distance_m: float = 0.0015
    u_raw_angle_rad: float = np.radians(0.001)
    u_square_rad: float = np.radians(0.2)
    """Of the angle between the beam at zero and the board's normal. It is not in eq. 21: d = L tan(angle) holds for a beam that
    starts square to the board."""
    u_zero_g_offset_g: float = 0.025 / np.sqrt(3)
    """Of the zero-g offset of the axis that reads the angle. Not in eq. 21: it changes the factor by half of it per radian."""


@dataclass(frozen=True, slots=True)
class ParameterContribution:
    """One cause of uncertainty of the parameter."""

    source: str
    type: str
    u_g: float


@dataclass(frozen=True, slots=True)
class SingleParameterFit:
    """The parameter A_z,off with its evidence."""

    a_z_off_g: float
    u_g: float
    pair_a_g: Array
    """A_z,off of each pair by eq. 13, shape (n,)."""
    pair_u_g: Array
    """Its standard uncertainty by eq. 21, shape (n,)."""
    pair_angle_rad: Array
    """Relative angle of the beam by eq. 19, shape (n,)."""
    contributions: tuple[ParameterContribution, ...]
    widened: float
    """Factor on the uncertainties because the pairs scatter more than these explain; 1 if they do not."""
    setup: LaserSetup


def beam_angle_rad(displacement_m: Array, distance_m: float) -> Array:
    """Return the relative angle of the beam (eq. 19)."""
    return np.arctan2(displacement_m, distance_m)


def pair_parameters_g(pairs: DisplacementPairs, distance_m: float) -> Array:
    """Return A_z,off of each pair, g (eq. 13)."""
    return np.asarray(np.log(beam_angle_rad(pairs.displacement_m, distance_m) / pairs.raw_angle_rad))


def pair_uncertainties_g(pairs: DisplacementPairs, setup: LaserSetup) -> Array:
    """Return the standard uncertainty of A_z,off of each pair, g (eq. 21)."""
    by_displacement, by_distance, by_angle = _relative_changes(pairs, setup)
    return np.asarray(np.sqrt(by_displacement**2 + by_distance**2 + by_angle**2))


def fit_single_parameter(pairs: DisplacementPairs, setup: LaserSetup) -> SingleParameterFit:
    """Return the generalised least-squares mean of the pairs' parameters.

    The pairs share the distance, the squareness of the beam, the sensor's zero-g offset and, within a session, the zero: the mean
    of many pairs is no better than those. Raises `NotDeterminedError` for pairs outside the method's range.
    """
    check_pairs(pairs, setup.distance_m)
    angle = beam_angle_rad(pairs.displacement_m, setup.distance_m)
    by_displacement, by_distance, by_angle = _relative_changes(pairs, setup)
    causes = (
        ("displacement of the spot", "A", _with_zero(by_displacement, pairs.session)),
        ("raw angle", "A", _with_zero(by_angle, pairs.session)),
        ("distance", "B", by_distance),
        ("squareness of the beam at zero", "B", np.sin(angle) ** 2 / angle * setup.u_square_rad),
        ("zero-g offset of the reading axis", "B", angle / 2 * setup.u_zero_g_offset_g),
    )
    changes = np.vstack([change for _, _, change in causes])
    total = changes.T @ changes
    weights = np.linalg.solve(total, np.ones(len(angle)))
    weights /= weights.sum()
    values = pair_parameters_g(pairs, setup.distance_m)
    mean = float(weights @ values)
    if abs(mean) > MAX_A_G:
        raise NotDeterminedError(
            f"the angles by laser are {np.exp(mean):.3g} times those of the sensor, which no sensor errs by; give "
            "displacement_mm in mm, raw_angle_deg in degrees, and --distance-mm from the rotation axis to the board"
        )
    widened = _widening(values - mean, total)
    return SingleParameterFit(
        a_z_off_g=mean,
        u_g=widened * float(np.linalg.norm(changes @ weights)),
        pair_a_g=values,
        pair_u_g=pair_uncertainties_g(pairs, setup),
        pair_angle_rad=angle,
        contributions=tuple(
            ParameterContribution(source, kind, widened * float(np.linalg.norm(change @ weights)))
            for source, kind, change in causes
        ),
        widened=widened,
        setup=setup,
    )


def correct_relative_angle(raw_rad: Array, a_z_off_g: float) -> Array:
    """Return actual relative angles (eq. 11 and 12). Raises `InputError` beyond the method's range."""
    angle = np.exp(a_z_off_g) * np.asarray(raw_rad)
    beyond = np.flatnonzero(np.abs(angle) > RANGE_RAD)
    if len(beyond):
        worst_deg = np.degrees(np.ravel(angle)[beyond[0]])
        raise InputError(
            f"a relative angle of {worst_deg:.3f} deg is beyond +-{np.degrees(RANGE_RAD):g} deg, where one parameter does not "
            "hold; use a six-position calibration"
        )
    return np.asarray(angle)


def relative_angle_u_rad(raw_rad: Array, fit: SingleParameterFit, u_raw_rad: float) -> Array:
    """Return the standard uncertainty of corrected relative angles: eq. 20, with the approximation and the zero-g offset."""
    angle = correct_relative_angle(raw_rad, fit.a_z_off_g)
    factor = np.exp(fit.a_z_off_g)
    by_parameter = np.hypot(fit.u_g, approximation_error(fit.a_z_off_g) / np.sqrt(3)) * angle
    by_zero_g_offset = fit.setup.u_zero_g_offset_g / 2 * angle**2
    return np.asarray(np.sqrt(by_parameter**2 + (factor * u_raw_rad) ** 2 + by_zero_g_offset**2))


def approximation_error(offset_g: float) -> float:
    """Return the largest relative error within the range if A_z,off is this zero-g offset of z (Zhu et al. 2020, figure 7).

    It is nearly all exp(-A) in place of 1/(1 + A). A parameter that eq. 13 has measured as a ratio of angles does not have it.
    """
    angle = np.linspace(RANGE_RAD / APPROXIMATION_STEPS, RANGE_RAD, APPROXIMATION_STEPS)
    raw = np.arctan2(np.sin(angle), np.cos(angle) + offset_g)
    return float(np.max(np.abs(np.exp(offset_g) * raw / angle - 1)))


def check_pairs(pairs: DisplacementPairs, distance_m: float) -> None:
    """Raise `NotDeterminedError` for a pair that the method cannot use, by its number from 1."""
    angle = beam_angle_rad(pairs.displacement_m, distance_m)
    for number, (beam, raw) in enumerate(zip(angle.tolist(), pairs.raw_angle_rad.tolist(), strict=True), start=1):
        if beam * raw <= 0:
            raise NotDeterminedError(
                f"pair {number}: displacement and raw angle must be other than zero and of one sign (eq. 11 counts angles as "
                "initial minus updated: change the sign of one column)"
            )
        if abs(beam) > RANGE_RAD:
            raise NotDeterminedError(
                f"pair {number}: {np.degrees(beam):.2f} deg is beyond +-{np.degrees(RANGE_RAD):g} deg"
            )


def _relative_changes(pairs: DisplacementPairs, setup: LaserSetup) -> tuple[Array, Array, Array]:
    """Return the changes of A_z,off by one standard uncertainty of displacement, distance and raw angle, each (n,)."""
    d, distance = pairs.displacement_m, setup.distance_m
    square = (distance**2 + d**2) * beam_angle_rad(d, distance)
    by_displacement = distance * pairs.u_displacement_m / square
    return by_displacement, -d * setup.u_distance_m / square, setup.u_raw_angle_rad / pairs.raw_angle_rad


def _with_zero(change: Array, session: NDArray[np.int64]) -> Array:
    """Return independent changes of A_z,off, shape (m, n): of each pair alone, and of the zero of each session.

    Their root sum of squares cannot become negative by rounding where pairs on both sides of the zero cancel.
    """
    of_session = np.unique(session)[:, None] == session
    return np.vstack((np.sqrt(1 - SHARED_ZERO) * np.diag(change), np.sqrt(SHARED_ZERO) * of_session * change))


def _widening(residual: Array, covariance: Array) -> float:
    freedom = len(residual) - 1
    if freedom == 0:
        return 1.0
    ratio = float(residual @ np.linalg.solve(covariance, residual)) / freedom
    return float(np.sqrt(ratio)) if ratio > chi_square_quantile(CHANCE_LEVEL, freedom) / freedom else 1.0
