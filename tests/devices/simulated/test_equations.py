"""One statement of the equations of motion: numbers, arrays and symbols get the same from it."""

from collections.abc import Iterable

import casadi as ca
import numpy as np
import pytest

from devices.pendulum import equations
from devices.pendulum.equations import Scalar, Vector

N, N_RATE, DRIVE = (0.1, -0.05, -0.993), (0.02, 0.3, -0.013), (0.4, 0.1, -9.7)
M, M_RATE = (0.05, 0.02, -0.9985), (0.1, -0.2, 0.001)


def answers(n: Vector, n_rate: Vector, m: Vector, m_rate: Vector, drive: Vector) -> list[Scalar]:
    first, second = equations.accelerations_of_two(n, n_rate, m, m_rate, drive, drive, (7.0, 2.0), 0.1, 0.2, 0.3)
    force = equations.specific_force(n, n_rate, first, drive, 9.8, 3.0, 0.1, 0.2)
    return [*first, *second, *equations.transport_rate(n, n_rate, m), *equations.in_housing(n, m, force)]


def _vector(components: Iterable[Scalar]) -> Vector:
    x, y, z = components
    return x, y, z


def test_numbers_arrays_and_symbols_agree() -> None:
    vectors = (N, N_RATE, M, M_RATE, DRIVE)
    numbers = answers(*vectors)
    arrays = answers(*(_vector(np.full(4, each) for each in vector) for vector in vectors))
    symbols = [ca.SX.sym(f"v{i}", 3) for i in range(5)]
    symbolic = ca.Function("f", symbols, [ca.vertcat(*answers(*(_vector(ca.vertsplit(s)) for s in symbols)))])
    assert [each[2] for each in arrays] == numbers
    assert symbolic(*vectors).full()[:, 0] == pytest.approx(numbers, rel=1e-12)


def test_a_massless_rigging_leaves_one_pendulum() -> None:
    heavy, _ = equations.accelerations_of_two(N, N_RATE, M, M_RATE, DRIVE, DRIVE, (7.0, 2.0), 0.1, 0.0, 1e12)
    assert heavy == pytest.approx(equations.acceleration_of_direction(N, N_RATE, DRIVE, 7.0, 0.1), rel=1e-9)


def test_tensions_keep_both_ropes_at_their_lengths() -> None:
    """What the hook and the load do along their ropes is centripetal, and the hoist's own."""
    n, m, drive = np.array(N) / np.linalg.norm(N), np.array(M) / np.linalg.norm(M), np.array(DRIVE)
    rope, rigging = equations.tensions_of_two(tuple(n), N_RATE, tuple(m), M_RATE, DRIVE, DRIVE, (7.0, 2.0), 0.4, 0.3)
    hook = drive - rope * n + rigging * m
    load = drive - 0.3 * rigging * m
    assert n @ hook == pytest.approx(0.4 - 7.0 * np.dot(N_RATE, N_RATE))
    assert m @ (load - hook) == pytest.approx(-2.0 * np.dot(M_RATE, M_RATE))
