"""A step of the extended Kalman filter's prediction under all hypotheses at once."""

import numpy as np

from gateway.motion.rope_model import set_pair_diagonal
from gateway.motion.state_vector import LINE, LINE_RATE, RATE
from gateway.numerics.array import Array


def taylor_step(x: Array, rate: Array, jacobian: Array, time_s: float, moving: int) -> Array:
    """Advance states in place by a Taylor step of third order; return the transition matrix.

    `x`, `rate`: shape (m, n), `jacobian`: shape (m, n, n), which is overwritten; its rows from `moving` on are zero. The
    transition is returned without those rows, shape (m, moving, n).
    """
    jacobian *= time_s
    scaled = jacobian[:, :moving]
    within = scaled[:, :, :moving]
    later = within @ scaled
    later *= 1 / 6
    later += 0.5 * scaled  # A/2 + A^2/6
    x[:, :moving] += time_s * (rate[:, :moving] + np.matvec(later[:, :, :moving], rate[:, :moving]))
    transition: Array = within @ later
    transition += scaled
    transition.reshape(len(x), -1)[:, :: x.shape[1] + 1] += 1.0
    return transition


def advance_covariance(covariance: Array, transition: Array) -> None:
    """Advance covariances, shape (m, n, n), in place by the transition of the first states, shape (m, moving, n)."""
    moving = transition.shape[1]
    rows = transition @ covariance
    block = rows @ transition.transpose(0, 2, 1)
    block += block.transpose(0, 2, 1)
    covariance[:, :moving, :moving] = 0.5 * block
    covariance[:, :moving, moving:] = rows[:, :, moving:]
    covariance[:, moving:, :moving] = rows[:, :, moving:].transpose(0, 2, 1)


def add_line(x: Array, before: Array, transition: Array, k: Array, omega: float, time_s: float) -> None:
    """Add the motion of the fast oscillation, in place and exactly, because a step may be a large part of its period.

    `before`: the states at the beginning of the step, shape (m, n); `k`: g/L, shape (m,); `omega`: its angular frequency.
    """
    sine, cosine = float(np.sin(omega * time_s)), float(np.cos(omega * time_s))
    force, force_rate = before[:, LINE], before[:, LINE_RATE]
    by_force, by_force_rate = k * (sine / omega), k * ((1 - cosine) / omega**2)
    x[:, LINE] = cosine * force + sine / omega * force_rate
    x[:, LINE_RATE] = -omega * sine * force + cosine * force_rate
    x[:, RATE] += by_force[:, None] * force + by_force_rate[:, None] * force_rate
    for rows, columns, factor in (
        (LINE, LINE, cosine),
        (LINE_RATE, LINE_RATE, cosine),
        (LINE, LINE_RATE, sine / omega),
        (LINE_RATE, LINE, -omega * sine),
        (RATE, LINE, by_force),
        (RATE, LINE_RATE, by_force_rate),
    ):
        set_pair_diagonal(transition, rows, columns, np.full((2, len(x)), factor))
