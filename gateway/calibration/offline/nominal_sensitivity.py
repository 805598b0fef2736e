"""What a sensor's unit is worth where nobody says: from the readings themselves, to within the gates of the pose finder."""

import numpy as np

from gateway.calibration.offline.readings_file import Floats, Session
from gateway.calibration.poses.pose_finder import NORM_LIMIT, NominalSensitivity
from gateway.calibration.record import NotDeterminedError

BLOCK = 16
"""Readings averaged before looking at extremes: noise and knocks stay out."""
LEAST_TURN = 0.02
"""Half range below which a sensor in volts was not turned: noise only."""
LARGEST_ZERO = 0.5
"""In g. A zero further off is that of an analogue part, in the middle of its supply."""


def nominal_for(sessions: list[Session], units_per_g: float | None) -> NominalSensitivity:
    """Nominal sensitivity and zero. Raises `NotDeterminedError` where the readings do not tell them."""
    unit = sessions[0].unit
    means = np.concatenate([_block_means(session.raw) for session in sessions])
    norm = float(np.median(np.linalg.norm(means, axis=1)))
    if unit == "g" and abs(norm - 1) <= NORM_LIMIT:
        return NominalSensitivity(1.0)
    analogue = _from_extremes(means, units_per_g)
    if analogue is not None and (unit == "V" or np.max(np.abs(analogue.zero)) > LARGEST_ZERO * analogue.units_per_g):
        return analogue
    if unit == "V":
        raise NotDeterminedError(
            "the readings do not tell volts per g: every axis has to point up once and down once; take the missing poses"
        )
    return NominalSensitivity(units_per_g or norm)


def _block_means(raw: Floats) -> Floats:
    whole = len(raw) // BLOCK * BLOCK
    return raw[:whole].reshape(-1, BLOCK, 3).mean(axis=1) if whole else raw


def _from_extremes(means: Floats, units_per_g: float | None) -> NominalSensitivity | None:
    """Zero between the extremes of each axis; where an axis has one of them only, at its median: it lay across mostly.

    None where an axis was not turned.
    """
    low, middle, high = np.quantile(means, [0.01, 0.5, 0.99], axis=0)
    zero, half = (low + high) / 2, (high - low) / 2
    scale = units_per_g or float(half.max())
    zero = np.where(half > (1 - NORM_LIMIT) * scale, zero, middle)
    if scale < LEAST_TURN or np.any(np.maximum(high - zero, zero - low) < (1 - NORM_LIMIT) * scale):
        return None
    x, y, z = zero.tolist()
    return NominalSensitivity(scale, (x, y, z))
