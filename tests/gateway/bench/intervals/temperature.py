"""Planted temperature sessions: whether each interval of a coefficient holds."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from gateway.bench.thermal.ramp_calibration import calibrate_ramps
from gateway.bench.thermal.rest_calibration import learn_at_rest
from gateway.calibration.acceptance import make_record
from gateway.calibration.input_files import FileReadings
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.pose import FACES, Pose
from gateway.calibration.record import CalibrationRecord
from tests.gateway.bench.planted.thermal import (
    UP,
    Disturbances,
    ThermalTruth,
    draw_truth,
    service_at_rest,
    six_recordings,
)


def ramps(kind: str, duration_s: float, added: Disturbances) -> Callable[[int], list[bool]]:
    """Return a session of ramps or steps: for each interval of offset and sensitivity whether it holds."""

    def session(seed: int) -> list[bool]:
        random = np.random.default_rng([1, seed, round(duration_s)])
        truth = draw_truth(random)
        noisy = replace(added, white_g=random.uniform(0.0005, 0.003))
        found = calibrate_ramps(
            [
                FileReadings(Path(f"{number}.csv"), "g", time_s, raw, thermometer_c, 0)
                for number, (time_s, raw, thermometer_c) in enumerate(
                    six_recordings(random, truth, kind, duration_s, noisy)
                )
            ]
        )
        return [
            measured.ci95[0] <= value <= measured.ci95[1]
            for entry, *values in zip(found.summary, *truth.mean_slopes(found.range_c), strict=True)
            for measured, value in zip((entry.offset_mg_per_c, entry.sensitivity_percent_per_c), values, strict=True)
        ]

    return session


def at_rest(lean_deg: float, added: Disturbances, duration_s: float = 1800.0) -> Callable[[int], list[bool]]:
    """Return a session of service: whether the interval of the axis along the rope, which leans, holds."""

    def session(seed: int) -> list[bool]:
        random = np.random.default_rng([3, seed])
        truth = replace(draw_truth(random), offset_mg_per_c2=np.zeros(3))
        towards = random.uniform(0, 2 * np.pi)
        lean_rad = np.radians(lean_deg) * np.array([np.cos(towards), np.sin(towards)])
        time_s, raw, thermometer_c = service_at_rest(random, truth, lean_rad, duration_s, added)
        service = FileReadings(Path("service.mcap"), "g", time_s, raw, thermometer_c, 0)
        _, found = learn_at_rest([service], six_position_record(truth))
        slopes, scales = truth.mean_slopes((25.0, 25.0))
        return [found.ci95[0] <= slopes[2] + 10 * scales[2] <= found.ci95[1]]

    return session


def six_position_record(truth: ThermalTruth) -> CalibrationRecord:
    """Return the record that a sensor had before its service."""
    poses = []
    for up, face in zip(UP, FACES, strict=True):
        x, y, z = truth.reading_g(up, np.array([25.0]))[0].tolist()
        poses.append(Pose((x, y, z), (1e-5,) * 3, 300, face, temperature_c=25.0))
    return make_record(
        fit_six_positions(tuple(poses)), device_id="part-7", unit="g", software="0.1.0", by="bench",
        created_utc="2026-11-21T10:15:00Z", parent=None,
    )  # fmt: skip


CLEAN, LOOP = Disturbances(), Disturbances(loop_g=5e-4)
LAGS = {"clean": CLEAN, "thermometer 3 s late": Disturbances(lag_s=3.0), "element 3 s late": Disturbances(lag_s=-3.0)}
KINDS: dict[str, Callable[[int], list[bool]]] = {
    **{
        f"{name}, {what}": ramps(kind, duration_s, added)
        for name, kind, duration_s in (
            ("ramps of 120 s", "ramp", 120.0),
            ("ramps of 1500 s", "ramp", 1500.0),
            ("steps, 400 s", "steps", 400.0),
        )
        for what, added in {**LAGS, "hysteresis 0.5 mg": LOOP}.items()
    },
    "at rest, plumb": at_rest(0.0, CLEAN),
    "at rest, leaning by 1°, thermometer 3 s late": at_rest(1.0, Disturbances(lag_s=3.0)),
    "at rest, hysteresis 0.5 mg": at_rest(0.0, LOOP),
}
"""Kinds of sessions by name."""
