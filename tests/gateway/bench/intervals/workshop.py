"""Planted sessions of the other bench methods: whether each interval of a result holds."""

import io
import json
import tempfile
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from gateway.bench.girder_deflection import EndRotation, Girder, girder_deflection, relative_u
from gateway.bench.single_parameter import DisplacementPairs, LaserSetup, fit_single_parameter
from gateway.calibration.alignment.turn_advice import fit_turn
from gateway.calibration.record import CalibrationRecord, NotDeterminedError
from gateway.cli.main import main
from gateway.numerics.stats import NORMAL_975, student_quantile
from tests.benchmarks.laser import compress, measure_disturbed, random_scene
from tests.gateway.bench.blunders.campaign import SOUND
from tests.gateway.bench.blunders.session import Session
from tests.gateway.bench.planted.workshop import draw_sensor


def record_of(method: str) -> Callable[[int], list[bool]]:
    """Return a session through the command line: the intervals of offset and scale factor of the three axes."""

    def session(seed: int) -> list[bool]:
        random = np.random.default_rng([seed, len(method)])
        sensor = draw_sensor(random)
        with tempfile.TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):
            out = Path(folder) / "record.json"
            command = SOUND[method](Session(random, Path(folder), sensor))
            assert main([*command, "--json", str(out)]) == 0
            record = CalibrationRecord.model_validate(json.loads(out.read_text()))
        matrix = np.array(record.correction_matrix)
        offset_g = matrix @ (np.array(record.offset) - sensor.offset_g)
        scale = np.diag(matrix @ sensor.axes) - 1
        scores = np.concatenate([offset_g / record.u_zero_g_offset_g, scale / record.u_scale_factor])
        return [bool(abs(score) < NORMAL_975) for score in scores]

    return session


def single_parameter(seed: int) -> list[bool]:
    """Return whether the interval of A_z,off holds, with a distance, a beam and a board that are off as stated."""
    random = np.random.default_rng([seed, 1])
    setup = LaserSetup(random.uniform(2.5, 6.0))
    offset_g = random.normal(0, [setup.u_zero_g_offset_g, 0.015])
    square_rad, distance_m = (
        random.normal(0, setup.u_square_rad),
        setup.distance_m + random.normal(0, setup.u_distance_m),
    )
    actual_rad = np.radians(np.append(np.linspace(-4.0, 4.0, 8) + random.uniform(-0.2, 0.2, 8), 0.0))
    reading_rad = np.arctan2(np.sin(actual_rad) + offset_g[0], np.cos(actual_rad) + offset_g[1])
    half = np.sqrt(0.5)  # of the variance of a pair is that of its zero
    reading_rad += half * setup.u_raw_angle_rad * random.standard_normal(9)
    on_board_m = distance_m * np.sin(actual_rad) / np.cos(actual_rad + square_rad)
    on_board_m += half * 5e-5 * random.standard_normal(9)
    pairs = DisplacementPairs(
        on_board_m[:-1] - on_board_m[-1], np.full(8, 5e-5), reading_rad[:-1] - reading_rad[-1], np.zeros(8, np.int64)
    )
    found = fit_single_parameter(pairs, setup)
    truth = np.log(1 + offset_g[1] + offset_g[0] ** 2 / (1 + offset_g[1]))
    return [abs(found.a_z_off_g - truth) < NORMAL_975 * found.u_g]


def girder(seed: int) -> list[bool]:
    """Return whether the interval of a deflection holds, by two sensors with their errors, and lengths as stated."""
    random = np.random.default_rng([seed, 2])
    stated = Girder(random.uniform(0.8, 14.0), 0.0, 0.001, 0.0)
    actual = Girder(stated.half_span_m + random.normal(0, 0.001), 0.0)
    rotation_rad, u_random_rad = random.uniform(1e-3, 8e-3), 2e-5
    ends = []
    for _ in range(2):
        scale_x, scale_z, offset_z_g = 1 + random.normal(0, 0.01), 1 + random.normal(0, 0.01), random.normal(0, 0.01)
        read = [
            np.arctan2(scale_x * np.sin(angle), scale_z * np.cos(angle) + offset_z_g) for angle in (0.0, rotation_rad)
        ]
        u_relative = relative_u(np.full(3, 0.01), np.full(3, 0.01), 0)
        ends.append(EndRotation(read[1] - read[0] + random.normal(0, u_random_rad), u_random_rad, u_relative))
    found = girder_deflection(ends[0], ends[1], stated)
    return [abs(found.deflection_m - actual.factor_m * rotation_rad) < NORMAL_975 * found.u_m]


def alignment(seed: int) -> list[bool]:
    """Return whether the intervals of both tilts of an axis along a shaft hold, turned unevenly about it."""
    random = np.random.default_rng([seed, 3])
    angle = 2 * np.pi * 1.02 * np.sort(random.random(300))
    tilts = np.radians(random.uniform(-1.2, 1.2, 2))
    across = np.column_stack([np.cos(angle), np.sin(angle)])
    force_g = np.column_stack([across @ tilts, across]) + random.normal(0, 0.03, 3)
    turn = fit_turn(force_g + random.uniform(1e-4, 1e-3) * random.standard_normal(force_g.shape), 0)
    assert turn is not None
    return [
        abs(found - tilt) < student_quantile(0.975, 21) * turn.u_rad
        for found, tilt in zip(turn.towards[1:], tilts.tolist(), strict=True)
    ]


def laser(seed: int) -> list[bool]:
    """Return whether the interval of a displacement between two photographs holds, JPEG of quality 75; empty: one was refused."""
    try:
        found, error_mm = measure_disturbed(compress, *random_scene(seed))
    except NotDeterminedError:
        return []
    return [abs(error_mm) < NORMAL_975 * 1000 * found.u_d_m]


KINDS: dict[str, Callable[[int], list[bool]]] = {
    **{method: record_of(method) for method in ("six-position", "norm-fit", "rotation")},
    "single parameter": single_parameter,
    "girder": girder,
    "alignment": alignment,
    "laser, JPEG of quality 75": laser,
}
"""Kinds of sessions by name."""
