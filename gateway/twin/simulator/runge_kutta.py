"""The integration step: an explicit Runge-Kutta method of order six in seven stages (Butcher 1964; Hairer et al. 1993, II.5)."""

from collections.abc import Callable

from gateway.twin.simulator.state import Expression

NODES = (0.0, 1 / 3, 2 / 3, 1 / 3, 1 / 2, 1 / 2, 1.0)
"""Time of each stage, as a part of the step (Butcher 1964)."""
STAGES = (
    (),
    (1 / 3,),
    (0.0, 2 / 3),
    (1 / 12, 1 / 3, -1 / 12),
    (-1 / 16, 9 / 8, -3 / 16, -3 / 8),
    (0.0, 9 / 8, -3 / 8, -3 / 4, 1 / 2),
    (9 / 44, -9 / 11, 63 / 44, 18 / 11, 0.0, -16 / 11),
)
"""Weights of the earlier rates in the state of each stage (Butcher 1964)."""
WEIGHTS = (11 / 120, 0.0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120)
"""Weights of the rates in the state at the end of the step (Butcher 1964)."""


def runge_kutta_step(
    rate: Callable[[Expression, Expression], Expression], state: Expression, time_s: Expression, step_s: Expression
) -> Expression:
    """Return the state after a step, for `rate(state, time_s)`."""
    rates: list[Expression] = []
    for node, weights in zip(NODES, STAGES, strict=True):
        rates.append(rate(_moved(state, step_s, weights, rates), time_s + node * step_s))
    return _moved(state, step_s, WEIGHTS, rates)


def _moved(state: Expression, step_s: Expression, weights: tuple[float, ...], rates: list[Expression]) -> Expression:
    terms = [weight * each for weight, each in zip(weights, rates, strict=True) if weight]
    return state + step_s * sum(terms) if terms else state
