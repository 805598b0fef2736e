"""A symbolic function evaluated for many instants at once: its instructions, one after the other, on whole arrays.

CasADi's own loop over columns takes some 10 ns for each instruction and column, numpy under 1 ns.
"""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Operation = Callable[..., Any]
AT_ONCE = 2048
"""Columns in one go, so that what is in work stays in the processor's cache."""


def _as_number(comparison: Operation) -> Operation:
    return lambda *operands: np.asarray(comparison(*operands), dtype=np.float64)


OPERATIONS: dict[int, Operation] = {
    ca.OP_ASSIGN: np.positive,
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_SQRT: np.sqrt,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_INV: np.reciprocal,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: np.sign,
    ca.OP_FMIN: np.minimum,
    ca.OP_FMAX: np.maximum,
    ca.OP_LT: _as_number(np.less),
    ca.OP_LE: _as_number(np.less_equal),
    ca.OP_EQ: _as_number(np.equal),
    ca.OP_NE: _as_number(np.not_equal),
    ca.OP_NOT: _as_number(np.logical_not),
    ca.OP_AND: _as_number(np.logical_and),
    ca.OP_OR: _as_number(np.logical_or),
    ca.OP_IF_ELSE_ZERO: lambda condition, value: np.where(condition, value, 0.0),
}


class VectorisedFunction:
    """`output` (a column) as a function of columns of inputs and of parameters that are the same for all."""

    def __init__(self, inputs: Sequence[Any], p: Any, output: Any) -> None:
        function = ca.Function("tape", [*inputs, p], [ca.densify(output)])
        self.rows = output.numel()
        self._parameters = len(inputs)
        self._slots = function.sz_w()
        self._steps: list[tuple[Operation | None, int, tuple[int, ...]]] = []
        for i in range(function.n_instructions()):
            self._take(function, i)

    def _take(self, function: Any, i: int) -> None:
        kind = function.instruction_id(i)
        into, of = function.instruction_output(i), function.instruction_input(i)
        if kind == ca.OP_CONST:
            self._steps.append((_constant(function.instruction_constant(i)), into[0], ()))
        elif kind == ca.OP_INPUT:
            self._steps.append((None, into[0], (of[0], of[1])))
        elif kind == ca.OP_OUTPUT:
            self._steps.append((None, -1 - into[1], (of[0],)))
        elif kind in OPERATIONS:
            self._steps.append((OPERATIONS[kind], into[0], tuple(of)))
        else:
            raise NotImplementedError(f"operation {kind} of CasADi has no array form here")

    def __call__(self, inputs: Sequence[Array], p: Array) -> Array:
        """Inputs of shape (rows, n) or (n,); returns (n, outputs)."""
        columns = [np.atleast_2d(each) for each in inputs]
        count = columns[0].shape[1]
        found = np.empty((self.rows, count))
        for first in range(0, count, AT_ONCE):
            part = slice(first, first + AT_ONCE)
            with np.errstate(all="ignore"):  # what runs away shows in the numbers
                self._run([each[:, part] for each in columns], p, found[:, part])
        return found.T

    def _run(self, columns: list[Array], p: Array, found: Array) -> None:
        work: list[Any] = [0.0] * self._slots
        for operation, into, of in self._steps:
            if operation is not None:
                work[into] = operation(*[work[i] for i in of])
            elif into < 0:
                found[-1 - into] = work[of[0]]
            else:
                work[into] = p[of[1]] if of[0] == self._parameters else columns[of[0]][of[1]]


class VectorisedJacobian:
    """A sparse Jacobian for many columns, filled into dense arrays."""

    def __init__(self, inputs: Sequence[Any], p: Any, output: Any, by: Any) -> None:
        jacobian = ca.jacobian(output, by)
        self.shape: tuple[int, int] = jacobian.shape
        rows, columns = jacobian.sparsity().get_triplet()
        self._places = np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)
        self._entries = VectorisedFunction(inputs, p, ca.vertcat(ca.SX(0, 1), *jacobian.nonzeros()))

    def __call__(self, inputs: Sequence[Array], p: Array) -> Array:
        """Shape (n, outputs, variables)."""
        entries = self._entries(inputs, p)
        found = np.zeros((len(entries), *self.shape))
        found[:, self._places[0], self._places[1]] = entries
        return found


def _constant(value: float) -> Operation:
    return lambda: value
