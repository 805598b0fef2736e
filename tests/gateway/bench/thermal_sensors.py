"""Simulated temperature ramps of the sensors of Sawicki and Walendziuk 2016, Tables 3 to 6."""

import json
from pathlib import Path
from typing import Literal

import numpy as np

from gateway.calibration.input_files import FileReadings
from gateway.calibration.pose import FACE_DIRECTIONS
from gateway.numerics.array import Array

TABLES = json.loads((Path(__file__).parents[2] / "data" / "calibration" / "sawicki_2016_thermal.json").read_text())
SENSORS = ("ADXL335", "ADXL327", "LIS344ALH", "MPU-9255")
RATE_HZ = 20.0
NOISE_G = 0.003


def planted(sensor: str) -> tuple[Array, Array, Array, Array]:
    """Return zero-g offset and sensitivity at 25 °C in raw units, mg/°C and %/°C of a sensor, each of shape (3,)."""
    table = TABLES["table_4"] if sensor == "MPU-9255" else TABLES["table_3"][sensor]
    return (
        np.array([table["zero_g"][axis] for axis in "xyz"], dtype=np.float64),
        np.array([table["sensitivity"][axis] for axis in "xyz"], dtype=np.float64),
        np.array(TABLES["table_6_zero_g_mg_per_c"][sensor]),
        np.array(TABLES["table_5_sensitivity_percent_per_c"][sensor]),
    )


def ramps(
    sensor: str,
    random: np.random.Generator,
    *,
    duration_s: float = 600.0,
    quadratic_mg: float = 0.0,
    low_c: float = 0.0,
    high_c: float = 60.0,
) -> list[FileReadings]:
    """Return one ramp per face, heating from `low_c` to `high_c`; `quadratic_mg` is the square of z, mg/°C²."""
    unit: Literal["counts", "V"] = "counts" if sensor == "MPU-9255" else "V"
    zero_g, sensitivity, offset_mg, scale_percent = planted(sensor)
    count = round(duration_s * RATE_HZ)
    time_s = np.arange(count) / RATE_HZ
    files = []
    for number, up in enumerate(FACE_DIRECTIONS.values()):
        temperature_c = low_c + (high_c - low_c) * time_s / duration_s + 0.05 * random.standard_normal(count)
        from_reference_c = (temperature_c - 25.0)[:, None]
        square_g = np.array([0.0, 0.0, quadratic_mg / 1000]) * from_reference_c**2
        force_g = up + offset_mg / 1000 * from_reference_c + square_g + scale_percent / 100 * from_reference_c * up
        raw = zero_g + sensitivity * (force_g + NOISE_G * random.standard_normal((count, 3)))
        files.append(
            FileReadings(
                Path(f"ramp{number}.csv"), unit, time_s, np.rint(raw) if unit == "counts" else raw, temperature_c, 0
            )
        )
    return files
