"""Array evaluation of symbolic functions against CasADi's own."""

import casadi as ca
import numpy as np
import pytest

from gateway.twin.simulator.vectorised_function import AT_ONCE, VectorisedFunction, VectorisedJacobian


@pytest.mark.slow
def test_every_operation_and_more_columns_than_go_at_once():
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    a, b, c = x[0], x[1], x[2]
    expressions = [a + b, a - b * p[0], a / b, -a, ca.exp(a), ca.log(b), b**a, b**3, ca.sqrt(b), a * a, 2 * a, 1 / b]
    expressions += [
        ca.sin(a),
        ca.cos(a),
        ca.tan(a),
        ca.atan2(a, b),
        ca.fabs(a),
        ca.sign(a),
        ca.fmin(a, c),
        ca.fmax(a, c),
    ]
    expressions += [(a < c) * b, (a <= c) + (b < c), ca.if_else(a > c, b, p[1]), ca.logic_not(a > c), ca.SX(7.0)]
    expressions += [ca.logic_and(a < c, b < c), ca.logic_or(a < c, b < c), ca.eq(a, c), ca.ne(a, c)]
    output = ca.vertcat(*expressions)
    random = np.random.default_rng(1)
    columns = random.uniform(0.2, 2.0, (3, AT_ONCE + 5))
    parameters = np.array([0.3, -4.0])
    expected = ca.Function("f", [x, p], [output]).map(columns.shape[1])(
        columns, np.tile(parameters[:, None], columns.shape[1])
    )
    assert VectorisedFunction([x], p, output)([columns], parameters) == pytest.approx(expected.full().T, rel=1e-12)


def test_a_sparse_jacobian_is_filled_in_its_places():
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p")
    tape = VectorisedJacobian([x], p, ca.vertcat(x[0] * p, x[1] * x[2]), ca.vertcat(x, p))
    found = tape([np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])], np.array([10.0]))
    assert found.tolist() == [[[10, 0, 0, 1], [0, 5, 3, 0]], [[10, 0, 0, 2], [0, 6, 4, 0]]]


def test_an_operation_without_an_array_form_is_refused():
    x = ca.SX.sym("x")
    with pytest.raises(NotImplementedError, match="no array form"):
        VectorisedFunction([x], ca.SX(0, 1), ca.erf(x))
