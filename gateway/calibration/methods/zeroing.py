"""Zero in place: a load that hangs still makes the rope its own plumb line, and the mount's two angles go (000 sec. 8).

What reads as a mount's angle there may as well be a zero-g offset across the rope: the two cannot be told apart from one
attitude, and what is removed is their sum. The turn about the rope is not seen and is left alone.
"""

import numpy as np

from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.methods.misalignment import inverse, misalignment_deg
from gateway.calibration.poses.mean_uncertainty import correlation_factor
from gateway.calibration.poses.pose import Array, RawReadings
from gateway.calibration.poses.stillness import StillnessGate
from gateway.calibration.poses.windows import Window, Windows
from gateway.calibration.record import CalibrationError, CalibrationRecord, NotDeterminedError
from gateway.calibration.uncertainty import Contribution, budget, prediction_interval_g, total

METHOD = "zero"
LEAST_S = 30.0
"""At rest without a break: two swings of a 50 m rope."""
STILL_SHARE = 0.95
"""Of the windows; a door that slams costs one."""
WANDER_LIMIT_G = 0.002
"""Between the means of the first and the second half, and of any window and the whole: 0.1 degrees is a load that swings."""
LARGEST_TURN_DEG = 10.0
"""A mount that is further off is put right by hand, not by numbers."""
PLUMB_U_DEG = 0.05
"""Standard uncertainty of the rope as a plumb line, per direction: its stiffness, a breath of wind."""
SUM_WARNING = (
    "zeroed in place: zero-g offset and mount error across the rope were removed as a sum; "
    "in other attitudes the offset's share shows again"
)


def zero(
    readings: RawReadings,
    parent: CalibrationRecord,
    turn: Array,
    units_per_g: float,
    plumb_u_deg: float = PLUMB_U_DEG,
) -> CalibrationFit:
    """The parent's correction, turned by the least angle that makes the mean point along the housing's +z.

    `readings` in the sensor's axes of a load that hangs still, `turn` the housing's axes from the sensor's (3, 3), as of
    `correction_for`. Raises `NotDeterminedError` where they are too short or not still, `CalibrationError` where they and
    the parent do not belong together.
    """
    windows = _resting(readings, units_per_g)
    counts = np.array([window.count for window in windows], dtype=np.float64)
    means = np.array([window.mean for window in windows])
    mean = counts @ means / counts.sum()
    matrix, offset = np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64)
    sigma = np.sqrt(sum(window.square_sum for window in windows) / (counts.sum() - len(windows)))
    _check_wander((means - mean) @ matrix.T, np.linalg.norm(matrix, axis=1) * sigma / np.sqrt(counts.mean()))
    _check_reading(matrix @ (mean - offset), parent, turn)
    type_a = sigma / np.sqrt(counts.sum()) * correlation_factor(means, counts, sigma)
    zeroed = _turned(matrix, offset, mean, turn)
    contributions = _contributions(parent, mean, type_a, turn, np.radians(plumb_u_deg))
    covariance = total(contributions)
    known = [window.temperature_c for window in windows if window.temperature_c is not None]
    x, y, z = parent.offset
    return CalibrationFit(
        method=METHOD,
        offset=(x, y, z),
        correction_matrix=zeroed,
        covariance=covariance,
        prediction_interval_g=max(
            float(parent.prediction_interval_g),
            prediction_interval_g(zeroed, covariance, float(np.max(sigma)) / units_per_g),
        ),
        poses=(),
        temperature_c={"mean": float(np.mean(known)), "min": min(known), "max": max(known)} if known else None,
        misalignment_deg=misalignment_deg(inverse(zeroed)),
        residual_rms_g=abs(float(np.linalg.norm(zeroed @ (mean - offset))) - 1),
        condition_number=1.0,
        budget=budget(zeroed, contributions),
        warnings=(SUM_WARNING, _turn_text(matrix, offset, mean, turn)),
    )


def zeroing_rotation(direction: Array) -> Array:
    """The least rotation that takes a unit vector to +z, shape (3, 3); it has no part about z."""
    x, y, z = direction
    # Rodrigues with axis (y, -x, 0): sine hypot(x, y), cosine z.
    return np.array(
        [[1 - x * x / (1 + z), -x * y / (1 + z), -x], [-x * y / (1 + z), 1 - y * y / (1 + z), -y], [x, y, z]]
    )


def _resting(readings: RawReadings, units_per_g: float) -> list[Window]:
    windows = Windows().feed(readings)
    gate = StillnessGate(units_per_g)
    judged = [(window, gate.is_still(window)) for window in windows]
    last_gap = max((place for place, (window, _) in enumerate(judged) if window.after_gap), default=0)
    judged = judged[last_gap:]
    duration_s = judged[-1][0].end_s - judged[0][0].start_s if judged else 0.0
    if duration_s < LEAST_S:
        raise NotDeterminedError(f"{duration_s:.0f} s without a break; let the load hang still for {LEAST_S:.0f} s")
    still = [window for window, found in judged if found]
    if len(still) < STILL_SHARE * len(judged):
        raise NotDeterminedError(
            f"moving in {len(judged) - len(still)} of {len(judged)} windows; let the load hang still"
        )
    return still


def _check_wander(deviation_g: Array, noise_g: Array) -> None:
    """The means of windows, shape (k, 3), must not scatter by more than their noise, shape (3,), and the limit."""
    half = len(deviation_g) // 2
    drift_g = float(np.max(np.abs(deviation_g[:half].mean(axis=0) - deviation_g[half:].mean(axis=0))))
    swing_g = float(np.sqrt(2 * np.max(np.clip(deviation_g.var(axis=0) - noise_g**2, 0, None))))
    if max(drift_g, swing_g) > WANDER_LIMIT_G:
        raise NotDeterminedError(
            f"the mean wanders by {max(drift_g, swing_g) * 1000:.1f} mg: the load still swings; let it come to rest"
        )


def _check_reading(corrected: Array, parent: CalibrationRecord, turn: Array) -> None:
    norm = float(np.linalg.norm(corrected))
    if abs(norm - 1) > parent.prediction_interval_g:
        raise CalibrationError(
            f"|m| at rest is {norm:.4f}, outside 1 +- {parent.prediction_interval_g:.4f} of record {parent.id}; recalibrate first"
        )
    angle_deg = float(np.degrees(np.arccos(np.clip((turn @ corrected)[2] / norm, -1, 1))))
    if angle_deg > LARGEST_TURN_DEG:
        raise CalibrationError(
            f"the housing reads {angle_deg:.1f} deg off the vertical, more than {LARGEST_TURN_DEG:g}; "
            "check axes_map and the clamp, or align it with the screws"
        )


def _turned(matrix: Array, offset: Array, mean: Array, turn: Array) -> Array:
    """The correction matrix after zeroing at the mean reading `mean`."""
    housing = turn @ matrix @ (mean - offset)
    return np.asarray(turn.T @ zeroing_rotation(housing / np.linalg.norm(housing)) @ turn @ matrix)


def _turn_text(matrix: Array, offset: Array, mean: Array, turn: Array) -> str:
    x, y, z = turn @ matrix @ (mean - offset)
    return f"removed pitch {np.degrees(np.arctan2(x, z)):+.3f} deg and roll {np.degrees(np.arctan2(y, z)):+.3f} deg"


def _contributions(
    parent: CalibrationRecord, mean: Array, type_a: Array, turn: Array, plumb_rad: float
) -> tuple[Contribution, ...]:
    """The parent's covariance carried through the turn, which takes the two angles' share away, and what zeroing adds."""
    by_record, by_mean = _jacobians(parent, mean, turn)
    carried = by_record @ np.array(parent.covariance) @ by_record.T
    matrix = _turned(np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64), mean, turn)
    plumb = np.zeros((12, 2))
    for place, axis in enumerate(turn[:2]):  # about the housing's x and y, in the sensor's axes
        plumb[:9, place] = np.cross(axis, matrix.T).T.ravel()
    return (
        Contribution(f"record {parent.id}", "B", carried),
        Contribution("noise of the mean at rest", "A", by_mean @ np.diag(type_a**2) @ by_mean.T),
        Contribution("the rope as a plumb line", "B", plumb_rad**2 * plumb @ plumb.T),
    )


def _jacobians(parent: CalibrationRecord, mean: Array, turn: Array) -> tuple[Array, Array]:
    """Of the new parameters by the parent's (12, 12) and by the mean reading (12, 3), by central differences."""
    matrix, offset = np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64)
    start = np.concatenate([matrix.ravel(), offset, mean])
    unit = 1 / np.linalg.norm(matrix)  # raw units per g
    steps = 1e-5 * np.concatenate([np.full(9, 1 / unit), np.full(6, unit)])
    jacobian = np.empty((12, 15))
    for place, step in enumerate(steps):
        ends = []
        for sign in (1, -1):
            shifted = start.copy()
            shifted[place] += sign * step
            ends.append(_parameters(shifted, turn))
        jacobian[:, place] = (ends[0] - ends[1]) / (2 * step)
    return jacobian[:, :12], jacobian[:, 12:]


def _parameters(start: Array, turn: Array) -> Array:
    matrix = _turned(start[:9].reshape(3, 3), start[9:12], start[12:], turn)
    return np.concatenate([matrix.ravel(), start[9:12]])
