"""One sensor read the whole recording: what its pieces say of its errors must agree.

A short piece tells the lean from a zero-g offset by little, and wrongly where the rope moves unnoticed in it; lean, offset and
angle are then wrong together. The lean itself may change from piece to piece (a side pull does): it shows in the mean of what is
read, and is not held to anything here. The sensor's errors do not change.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.swing.estimation.hoist_tracking import FittedInterval
from gateway.swing.estimation.robust_fit import FitResult, inflate_uncertainty
from gateway.swing.fit.priors import ERRORS
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.uncertainty.peaks import largest_angle, largest_angle_slope

CHANCE = 1.5
"""Standard deviations by which two may differ."""


@dataclass(frozen=True, slots=True)
class SegmentEstimate:
    """What a piece says of the errors of sensor and housing that are unknown, in standard deviations of the beliefs."""

    errors: Real
    gained: Real
    """Information on them beyond the beliefs, shape (free, free)."""
    angle_rad: float
    """The piece's largest angle."""
    u_rad: float
    angle_by_errors: Real
    """By which the angle follows when the errors are known to be others."""


def enforce_common_sensor_errors(pieces: list[FittedInterval]) -> tuple[list[FittedInterval], tuple[str, ...]]:
    """The pieces, and what is to be said of them.

    Where a piece's angle would be another with the sensor that the others show, the part of the difference that chance does
    not explain goes into its uncertainty.
    """
    if len(pieces) < 2 or not _free(pieces[0].finding).any():
        return pieces, ()
    witnesses = [_witness(piece.finding) for piece in pieces]
    found, odd = [], []
    for place, (piece, witness) in enumerate(zip(pieces, witnesses, strict=True)):
        unexplained_rad = _unexplained_rad(witness, witnesses[:place] + witnesses[place + 1 :])
        found.append(replace(piece, finding=inflate_uncertainty(piece.finding, unexplained_rad / witness.angle_rad)))
        if unexplained_rad > witness.u_rad:
            odd.append(f"{piece.from_s:.0f}-{piece.to_s:.0f} s")
    return found, (f"widened: alone, {', '.join(odd)} would show another sensor than the rest",) if odd else ()


def _unexplained_rad(one: SegmentEstimate, others: list[SegmentEstimate]) -> float:
    """How much farther an angle moves under the sensor of the others than chance lets it."""
    believed = np.eye(len(one.errors))
    theirs = np.linalg.inv(believed + sum(other.gained for other in others))
    errors = theirs @ sum((believed + other.gained) @ other.errors for other in others)
    own = np.linalg.inv(believed + one.gained)
    difference = own + theirs - own @ theirs - theirs @ own  # of two that start from the same beliefs
    shift_rad = float(one.angle_by_errors @ (errors - one.errors))
    chance_rad2 = float(one.angle_by_errors @ difference @ one.angle_by_errors)
    return float(np.sqrt(max(shift_rad**2 - CHANCE**2 * chance_rad2, 0.0)))


def _witness(finding: FitResult) -> SegmentEstimate:
    fit, free = finding.fit, _free(finding)
    count, deviation = int(free.sum()), fit.beliefs.deviation[-ERRORS:][free]
    covariance = finding.claim.covariance[:, -count:] / deviation
    own = covariance[-count:] / deviation[:, None]
    values, vectors = np.linalg.eigh(np.linalg.inv((own + own.T) / 2) - np.eye(count))
    angle_rad, u_rad = largest_angle(fit, finding.claim)
    return SegmentEstimate(
        errors=fit.instrument.errors[free] / deviation,
        gained=(vectors * np.maximum(values, 0.0)) @ vectors.T,
        angle_rad=max(angle_rad, 1e-6),
        u_rad=u_rad,
        angle_by_errors=np.asarray(np.linalg.solve(own, largest_angle_slope(fit) @ covariance), dtype=np.float64),
    )


def _free(finding: FitResult) -> NDArray[np.bool_]:
    """Which of the errors of sensor and housing are unknown."""
    return finding.fit.free[-ERRORS:]
