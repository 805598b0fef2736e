"""Planted weeks of service: whether each interval of what swings and rests show of an installed housing holds."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from devices.axes_map import SAME_AXES
from devices.block import DeviceInfo
from gateway.bench.installed.free_motion import FreeMotionFinder
from gateway.bench.installed.installed_calibration import InstalledCalibration, calibrate_installed
from gateway.calibration.acceptance import add_content_hash
from gateway.calibration.correction import correction_for
from gateway.calibration.methods.zeroing import PLUMB_U_DEG
from gateway.calibration.record import CalibrationRecord
from gateway.pipeline.rig import BESIDE_U_M
from gateway.swing.rig import MountedHousing
from tests.gateway.bench.planted.service import Installed, Recorded, Weeks, draw_installed, weeks_of_service

DEVICE = DeviceInfo("test", "part-7", "g", odr_hz=20.0, units_per_g=1.0)
IN_UNITS = {"g": 1e3, "rad": 180 / np.pi, "m": 1.0}
"""Factor of a name's last word; of a scale factor 100."""


def wide_record(u_offset_g: float = 0.015, u_scale: float = 0.02) -> CalibrationRecord:
    """Return a record that knows a data sheet: no correction, and these standard uncertainties."""
    variance = [u_scale**2 if place in (0, 4, 8) else 1e-6 for place in range(9)] + [u_offset_g**2] * 3
    content = {
        "format": 1, "device_id": "part-7", "method": "six-position", "created_utc": "2026-01-01T00:00:00Z",
        "software": "0.1.0", "by": "bench", "parent": None, "unit": "g", "offset": [0.0, 0.0, 0.0],
        "correction_matrix": np.eye(3).tolist(), "covariance": np.diag(variance).tolist(),
        "prediction_interval_g": 0.05, "temperature_c": None,
    }  # fmt: skip
    return add_content_hash(content)


def calibrated(
    found: list[Recorded], housing: MountedHousing, record: CalibrationRecord | None = None
) -> InstalledCalibration:
    """Return the result for recordings and a believed housing."""
    parent = record or wide_record()
    finder = FreeMotionFinder(housing)
    windows = [window for each in found for window in finder.feed(each.time_s, each.raw_g)]
    return calibrate_installed(windows, parent, housing, correction_for(DEVICE, SAME_AXES, parent))


def believed(crane: Installed, place_error_m: float = 0.0) -> MountedHousing:
    """Return the housing as the configuration states it: the mount by eye, the place by a tape."""
    above_load_m = crane.above_load_m + place_error_m
    return MountedHousing(
        length_m=crane.length_m, above_load_m=above_load_m, position_u_m=0.05, mount_u_rad=0.01, mounted_on="rope"
    )


def service(weeks: Weeks) -> Callable[[int], list[bool]]:
    """Return a session of weeks on a crane: for each row that is determined, whether its interval holds the planted value."""

    def session(seed: int) -> list[bool]:
        random = np.random.default_rng([7, seed])
        crane = replace(draw_installed(random), beside_m=random.normal(0, BESIDE_U_M, 2))
        lean_x_rad, lean_y_rad = random.normal(0, np.radians(PLUMB_U_DEG), 2).tolist()
        found = weeks_of_service(random, crane, replace(weeks, steady_lean_rad=(lean_x_rad, lean_y_rad)))
        result = calibrated(found, believed(crane, random.normal(0, 0.01 * crane.length_m)))
        truth = crane.deviations(found) | {"place_m": crane.above_load_m}
        truth["across_x_g"] += lean_x_rad
        truth["across_y_g"] += lean_y_rad
        shown = {name: row for name, row in result.rows.items() if name in truth}
        return [
            abs(row.value - truth[name] * IN_UNITS.get(name.split("_")[-1], 100)) < row.half
            for name, row in shown.items()
        ]

    return session


KINDS: dict[str, Callable[[int], list[bool]]] = {
    "installed, 28 days of 3 swings": service(Weeks()),
    "installed, 10 days of 3 swings": service(Weeks(days=10)),
}
"""Kinds of sessions by name."""
