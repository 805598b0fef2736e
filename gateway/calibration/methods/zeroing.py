"""Zeroing in place: while the load hangs still, the rope is a plumb line, and the two angles of the mount are removed.

A mount angle and a zero-g offset across the rope cannot be distinguished in one attitude; their sum is removed (Łuczak et al.
2022, sec. 8). The turn about the rope does not show in the readings and stays.
"""

from dataclasses import replace

import numpy as np

from gateway.calibration.calibration_fit import (
    CalibrationFit,
    Contribution,
    FitWarning,
    misalignment_deg,
    prediction_interval_g,
    total_covariance,
    uncertainty_budget,
)
from gateway.calibration.pose import MIN_UNBROKEN_REST_S, RawReadings, temperature_range
from gateway.calibration.record import ZEROING, CalibrationError, CalibrationRecord, NotDeterminedError
from gateway.calibration.thermal_model import thermal_model
from gateway.calibration.windows import Rest, StillnessGate, WindowSplitter
from gateway.numerics.array import Array

MIN_STILL_SHARE = 0.95
"""Least share of still windows. Basis: a slammed door moves the load in one window of a minute."""
MAX_MEAN_CHANGE_G = 0.002
"""Largest change of the mean between the two halves, and largest amplitude of the windows' means, g. Basis: 0.1 degrees
of swing."""
MAX_MOUNT_ANGLE_DEG = 10.0
"""Largest angle that zeroing removes, degrees. Basis: a larger one is corrected at the mount."""
PLUMB_U_DEG = 0.05
"""Standard uncertainty of the rope as a plumb line, per direction, degrees. Basis: a choice; a millimetre per metre, for
stiffness of the rope and light wind."""
RELATIVE_STEP = 1e-5
"""Step of the central differences, relative to the size of the parameters. Basis: the cube root of the rounding error (6e-6),
which is best for central differences."""
SUM_WARNING = (
    "zeroed in place: zero-g offset and mount error across the rope were removed as a sum; "
    "in other attitudes the offset's share shows again"
)


def zero_in_place(
    readings: RawReadings,
    parent: CalibrationRecord,
    housing_from_sensor: Array,
    units_per_g: float,
) -> CalibrationFit:
    """Return the parent's correction with the smallest rotation in front that turns the mean to the housing's +z.

    `readings` of a load that hangs still, in the sensor's axes; `housing_from_sensor` as of `housing_rotation`, shape (3, 3).
    A thermal model of the parent is applied to them and kept. Raises `NotDeterminedError` if they are too short or not still,
    `CalibrationError` if they do not agree with the parent.
    """
    rest = _find_rest(_at_reference(readings, parent), units_per_g)
    mean, sigma = rest.mean(), rest.sigma()
    matrix, offset = np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64)
    noise_g = np.linalg.norm(matrix, axis=1) * sigma / np.sqrt(rest.counts().mean())
    _require_steady_mean((rest.means() - mean) @ matrix.T, noise_g)
    _require_plausible_reading(matrix @ (mean - offset), parent, housing_from_sensor)
    zeroed = _zeroed_matrix(matrix, offset, mean, housing_from_sensor)
    contributions = _contributions(parent, mean, rest.type_a(), housing_from_sensor)
    covariance = total_covariance(contributions)
    x, y, z = parent.offset
    return CalibrationFit(
        method=ZEROING,
        offset=(x, y, z),
        correction_matrix=zeroed,
        covariance=covariance,
        prediction_interval_g=max(
            float(parent.prediction_interval_g),
            prediction_interval_g(zeroed, covariance, float(np.max(sigma)) / units_per_g),
        ),
        poses=(),
        temperature_c=temperature_range(window.temperature_c for window in rest.windows),
        misalignment_deg=misalignment_deg(np.asarray(np.linalg.inv(zeroed), dtype=np.float64)),
        residual_rms_g=abs(float(np.linalg.norm(zeroed @ (mean - offset))) - 1),
        condition_number=1.0,
        budget=uncertainty_budget(zeroed, contributions),
        warnings=(
            FitWarning(SUM_WARNING),
            FitWarning(_removed_angles_text(matrix, offset, mean, housing_from_sensor)),
        ),
        thermal=parent.thermal,
    )


def zeroing_rotation(direction: Array) -> Array:
    """Return the smallest rotation that turns a unit vector to +z, shape (3, 3); it has no component about z."""
    x, y, z = direction
    # Rodrigues' formula with the axis (y, -x, 0), the sine hypot(x, y) and the cosine z
    return np.array(
        [[1 - x * x / (1 + z), -x * y / (1 + z), -x], [-x * y / (1 + z), 1 - y * y / (1 + z), -y], [x, y, z]]
    )


def _at_reference(readings: RawReadings, parent: CalibrationRecord) -> RawReadings:
    model = thermal_model(parent)
    if model is None or readings.temperature_c is None:
        return readings
    offset = np.array(parent.offset, dtype=np.float64)
    return replace(readings, raw=model.to_reference(readings.raw, offset, readings.temperature_c))


def _find_rest(readings: RawReadings, units_per_g: float) -> Rest:
    gate = StillnessGate(units_per_g)
    judged = [(window, gate.is_still(window)) for window in WindowSplitter().feed(readings)]
    last_gap = max((place for place, (window, _) in enumerate(judged) if window.after_gap), default=0)
    judged = judged[last_gap:]
    duration_s = judged[-1][0].end_s - judged[0][0].start_s if judged else 0.0
    if duration_s < MIN_UNBROKEN_REST_S:
        raise NotDeterminedError(
            f"{duration_s:.0f} s without a break; let the load hang still for {MIN_UNBROKEN_REST_S:.0f} s"
        )
    still = [window for window, is_still in judged if is_still]
    if len(still) < MIN_STILL_SHARE * len(judged):
        raise NotDeterminedError(
            f"moving in {len(judged) - len(still)} of {len(judged)} windows; let the load hang still"
        )
    return Rest(still)


def _require_steady_mean(deviation_g: Array, noise_g: Array) -> None:
    """Raise `NotDeterminedError` if the means of windows, (k, 3), scatter by more than their noise, (3,), and the limit."""
    half = len(deviation_g) // 2
    drift_g = float(np.max(np.abs(deviation_g[:half].mean(axis=0) - deviation_g[half:].mean(axis=0))))
    swing_g = float(np.sqrt(2 * np.max(np.clip(deviation_g.var(axis=0) - noise_g**2, 0, None))))
    if max(drift_g, swing_g) > MAX_MEAN_CHANGE_G:
        raise NotDeterminedError(
            f"the mean changes by {max(drift_g, swing_g) * 1000:.1f} mg: the load still swings; let it come to rest"
        )


def _require_plausible_reading(corrected: Array, parent: CalibrationRecord, housing_from_sensor: Array) -> None:
    norm_g = float(np.linalg.norm(corrected))
    if abs(norm_g - 1) > parent.prediction_interval_g:
        raise CalibrationError(
            f"|m| at rest is {norm_g:.4f}, outside 1 +- {parent.prediction_interval_g:.4f} of record {parent.id}; "
            "recalibrate first"
        )
    angle_deg = float(np.degrees(np.arccos(np.clip((housing_from_sensor @ corrected)[2] / norm_g, -1, 1))))
    if angle_deg > MAX_MOUNT_ANGLE_DEG:
        raise CalibrationError(
            f"the housing reads {angle_deg:.1f} deg off the vertical, more than {MAX_MOUNT_ANGLE_DEG:g}; "
            "check axes_map and the clamp, or align the housing with its screws"
        )


def _zeroed_matrix(matrix: Array, offset: Array, mean: Array, housing_from_sensor: Array) -> Array:
    """Return the correction matrix after zeroing at the mean reading `mean`."""
    housing = housing_from_sensor @ matrix @ (mean - offset)
    rotation = zeroing_rotation(housing / np.linalg.norm(housing))
    return np.asarray(housing_from_sensor.T @ rotation @ housing_from_sensor @ matrix)


def _removed_angles_text(matrix: Array, offset: Array, mean: Array, housing_from_sensor: Array) -> str:
    x, y, z = housing_from_sensor @ matrix @ (mean - offset)
    return f"removed pitch {np.degrees(np.arctan2(x, z)):+.3f} deg and roll {np.degrees(np.arctan2(y, z)):+.3f} deg"


def _contributions(
    parent: CalibrationRecord, mean: Array, type_a: Array, housing_from_sensor: Array
) -> tuple[Contribution, ...]:
    """Return the parent's covariance, propagated through the rotation that removes the two angles, and what zeroing adds."""
    parent_jacobian, mean_jacobian = _jacobians(parent, mean, housing_from_sensor)
    propagated = parent_jacobian @ np.array(parent.covariance) @ parent_jacobian.T
    offset = np.array(parent.offset, dtype=np.float64)
    matrix = _zeroed_matrix(np.array(parent.correction_matrix), offset, mean, housing_from_sensor)
    plumb = np.zeros((12, 2))
    for place, axis in enumerate(housing_from_sensor[:2]):  # about the housing's x and y, in the sensor's axes
        plumb[:9, place] = np.cross(axis, matrix.T).T.ravel()
    return (
        Contribution(f"record {parent.id}", "B", propagated),
        Contribution("noise of the mean at rest", "A", mean_jacobian @ np.diag(type_a**2) @ mean_jacobian.T),
        Contribution("the rope as a plumb line", "B", np.radians(PLUMB_U_DEG) ** 2 * plumb @ plumb.T),
    )


def _jacobians(parent: CalibrationRecord, mean: Array, housing_from_sensor: Array) -> tuple[Array, Array]:
    """Return the derivatives of the new parameters by the parent's (12, 12) and by the mean reading (12, 3), by differences."""
    matrix, offset = np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64)
    inputs = np.concatenate([matrix.ravel(), offset, mean])
    units_per_g = 1 / np.linalg.norm(matrix)
    steps = RELATIVE_STEP * np.concatenate([np.full(9, 1 / units_per_g), np.full(6, units_per_g)])
    jacobian = np.empty((12, 15))
    for place, step in enumerate(steps):
        ends = []
        for sign in (1, -1):
            shifted = inputs.copy()
            shifted[place] += sign * step
            ends.append(_zeroed_parameters(shifted, housing_from_sensor))
        jacobian[:, place] = (ends[0] - ends[1]) / (2 * step)
    return jacobian[:, :12], jacobian[:, 12:]


def _zeroed_parameters(inputs: Array, housing_from_sensor: Array) -> Array:
    matrix = _zeroed_matrix(inputs[:9].reshape(3, 3), inputs[9:12], inputs[12:], housing_from_sensor)
    return np.concatenate([matrix.ravel(), inputs[9:12]])
