"""Array evaluation of symbolic functions, against CasADi's own evaluation."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from gateway.twin.simulator.vectorised_function import (
    COLUMNS_AT_ONCE,
    UnsupportedOperationError,
    VectorisedFunction,
    VectorisedJacobian,
)

A, B, C = (ca.SX.sym(name) for name in "abc")
EXPRESSIONS: dict[str, Any] = {
    "add": A + B,
    "subtract": A - B,
    "multiply": A * B,
    "divide": A / B,
    "negate": -A,
    "inverse": 1 / B,
    "twice": 2 * A,
    "square": A * A,
    "square root": ca.sqrt(B),
    "power": B**A,
    "constant power": B**3,
    "hypot": ca.hypot(A, B),
    "exp": ca.exp(A),
    "expm1": ca.expm1(A),
    "log": ca.log(B),
    "log1p": ca.log1p(B),
    "log10": ca.log10(B),
    "sin": ca.sin(A),
    "cos": ca.cos(A),
    "tan": ca.tan(A),
    "asin": ca.asin(A / 3),
    "acos": ca.acos(A / 3),
    "atan": ca.atan(A),
    "atan2": ca.atan2(A, B),
    "sinh": ca.sinh(A),
    "cosh": ca.cosh(A),
    "tanh": ca.tanh(A),
    "asinh": ca.asinh(A),
    "acosh": ca.acosh(1 + A),
    "atanh": ca.atanh(A / 3),
    "erf": ca.erf(A),
    "abs": ca.fabs(A - 1),
    "sign": ca.sign(A - 1),
    "copysign": ca.copysign(A, B - 1),
    "floor": ca.floor(3 * A),
    "ceil": ca.ceil(3 * A),
    "fmod": ca.fmod(3 * A - 3, B),
    "remainder": ca.remainder(3 * A - 3, B),
    "fmin": ca.fmin(A, C),
    "fmax": ca.fmax(A, C),
    "less": (A < C) * B,
    "less or equal": (A <= C) + (B < C),
    "equal": ca.eq(A, C),
    "not equal": ca.ne(A, C),
    "if else": ca.if_else(A > C, B, 2.0),
    "not": ca.logic_not(A > C),
    "and": ca.logic_and(A < C, B < C),
    "or": ca.logic_or(A < C, B < C),
    "constant": ca.SX(7.0),
}


def values_of(expression: Any, columns: np.ndarray) -> Any:
    return ca.Function("f", [ca.vertcat(A, B, C)], [expression]).map(columns.shape[1])(columns).full().T


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPRESSIONS)
def test_operation_and_its_derivative_equal_those_of_casadi(name: str) -> None:
    columns, x, nothing = np.random.default_rng(1).uniform(0.2, 2.0, (3, 300)), ca.vertcat(A, B, C), ca.SX(0, 1)
    columns[2, :20] = columns[0, :20]  # equal numbers, for comparisons
    expression = EXPRESSIONS[name]
    found = VectorisedFunction([x], nothing, expression)([columns], np.zeros(0))
    assert found == pytest.approx(values_of(expression, columns), rel=1e-12, abs=1e-14)
    slopes = VectorisedJacobian([x], nothing, expression, x)([columns], np.zeros(0))[:, 0]
    expected = values_of(ca.densify(ca.jacobian(expression, x)).T, columns)
    np.testing.assert_allclose(slopes, expected, rtol=1e-11, atol=1e-13)


def test_more_columns_than_are_evaluated_at_once_with_parameters() -> None:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    output = ca.vertcat(x[0] * p[0], x[1] + p[1], x[2])
    columns = np.random.default_rng(1).uniform(0.2, 2.0, (3, COLUMNS_AT_ONCE + 5))
    found = VectorisedFunction([x], p, output)([columns], np.array([0.3, -4.0]))
    np.testing.assert_allclose(found, np.stack([0.3 * columns[0], columns[1] - 4.0, columns[2]], axis=1), rtol=1e-14)


def test_entries_of_a_sparse_jacobian_have_their_positions() -> None:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p")
    jacobian = VectorisedJacobian([x], p, ca.vertcat(x[0] * p, x[1] * x[2]), ca.vertcat(x, p))
    found = jacobian([np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])], np.array([10.0]))
    assert found.tolist() == [[[10, 0, 0, 1], [0, 5, 3, 0]], [[10, 0, 0, 2], [0, 6, 4, 0]]]


def test_operation_without_an_array_form_is_refused_by_name() -> None:
    with pytest.raises(UnsupportedOperationError, match="operation erfinv of CasADi has no array form"):
        VectorisedFunction([A], ca.SX(0, 1), ca.erfinv(A))
