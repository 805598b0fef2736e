"""A gyroscope in the housing, with the motion of an independent engine: what it adds, and what happens when it is wrong."""

from collections.abc import Callable

import numpy as np
import pytest

from gateway.motion.estimate import MotionEstimate
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.gyro_tracker import CONTRADICTS, SILENT
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.array import Array
from tests.benchmarks.motion_gyro import gyro_readings
from tests.benchmarks.motion_recordings import WorkRecording, generate
from tests.values import present

pytestmark = pytest.mark.slow
PRIOR = GyroPrior(np.radians(3.0))
UPDATE = 5
LAST_S = 50.0


@pytest.fixture(scope="module")
def crane() -> WorkRecording:
    """A crane at work: the first of the benchmark's recordings."""
    return next(iter(generate("plain", 2026, 1)))


def followed(
    crane: WorkRecording, rate_rad_s: Array | None, is_clipped: Callable[[float], bool] = lambda _: False
) -> tuple[list[MotionEstimate], MotionMonitor]:
    """The estimate of every tenth of a second."""
    monitor = MotionMonitor(crane.rig, mount_u_rad=1e-3, gyro=None if rate_rad_s is None else PRIOR)
    estimates = []
    for begin in range(0, int(np.searchsorted(crane.time_s, LAST_S)), UPDATE):
        part = slice(begin, begin + UPDATE)
        time_s = crane.time_s[part]
        clipped = np.full(len(time_s), is_clipped(float(time_s[-1])))
        monitor.update(time_s, crane.force_g[part], clipped, None if rate_rad_s is None else rate_rad_s[part])
        estimates.append(monitor.estimate(float(time_s[-1])))
    return estimates, monitor


def errors_deg(crane: WorkRecording, estimates: list[MotionEstimate], from_s: float = 15.0) -> Array:
    known = [e for e in estimates if e.angle_rad is not None and e.time_s > from_s]
    angle_deg = np.degrees([e.angle_rad for e in known])  # type: ignore[arg-type]
    found: Array = angle_deg - crane.true("angle_deg", np.array([e.time_s for e in known]))
    return found


@pytest.fixture(scope="module")
def without_gyro(crane: WorkRecording) -> list[MotionEstimate]:
    return followed(crane, None)[0]


def test_a_gyroscope_halves_the_error_and_its_bias_is_found(
    crane: WorkRecording, without_gyro: list[MotionEstimate]
) -> None:
    rate_rad_s = gyro_readings(crane, 3)
    estimates, monitor = followed(crane, rate_rad_s)
    error, plain = errors_deg(crane, estimates), errors_deg(crane, without_gyro)
    assert np.sqrt(np.mean(error**2)) < 0.6 * np.sqrt(np.mean(plain**2))
    assert not any("gyroscope" in reason for e in estimates for reason in e.reasons)
    assert crane.rate_rad_s is not None
    bias_rad_s = monitor.gyro_bias_rad_s()
    assert bias_rad_s is not None
    planted_rad_s = (rate_rad_s - crane.rate_rad_s)[: len(estimates) * UPDATE].mean(axis=0)
    assert np.degrees(bias_rad_s - planted_rad_s)[:2] == pytest.approx([0.0, 0.0], abs=0.05)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (np.zeros_like, SILENT),
        (lambda rate: rate[:, [1, 0, 2]], CONTRADICTS),
        (lambda rate: -rate, CONTRADICTS),
        (lambda rate: 1.5 * rate, CONTRADICTS),
    ],
    ids=["dead", "axes exchanged", "sign", "scale"],
)
def test_a_wrong_gyroscope_is_left_out_and_spoils_nothing(
    crane: WorkRecording, without_gyro: list[MotionEstimate], spoil: Callable[[Array], Array], reason: str
) -> None:
    assert crane.rate_rad_s is not None
    noise = np.random.default_rng(1).normal(scale=1e-3, size=crane.rate_rad_s.shape)
    wrong = spoil(crane.rate_rad_s) + (0.0 if reason == SILENT else noise)
    estimates, _ = followed(crane, wrong)
    assert reason in {text for e in estimates for text in e.reasons}
    plain_rms, rms = (np.sqrt(np.mean(errors_deg(crane, each) ** 2)) for each in (without_gyro, estimates))
    assert rms < 1.2 * plain_rms


def test_clipped_readings_are_bridged_by_the_gyroscope(crane: WorkRecording) -> None:
    def clipped(time_s: float) -> bool:
        return 45.0 < time_s < 45.8

    with_gyro, without = (followed(crane, rate, clipped)[0] for rate in (gyro_readings(crane, 3), None))
    at = int(np.argmin([abs(e.time_s - 45.7) for e in with_gyro]))
    assert present(with_gyro[at].u_rad) < 0.8 * present(without[at].u_rad)
