"""A symbolic function evaluated for many samples at once: its instructions, one after the other, on whole arrays.

CasADi's own loop over columns takes some 10 ns for each instruction and column, numpy less than 1 ns.
"""

import operator
from collections.abc import Callable, Sequence
from enum import Enum, auto
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]
Operation = Callable[..., Any]
COLUMNS_AT_ONCE = 4096
"""Columns that are evaluated together. Basis: a choice; intermediate results stay in the processor's cache."""


class UnsupportedOperationError(ValueError):
    """An expression contains an operation that has no array form."""

    def __init__(self, kind: int) -> None:
        names = [name for name in dir(ca) if name.startswith("OP_") and getattr(ca, name) == kind]
        self.operation = names[0].removeprefix("OP_").lower() if names else str(kind)
        super().__init__(f"the operation {self.operation} of CasADi has no array form")


def _as_number(comparison: Operation) -> Operation:
    return lambda *operands: np.asarray(comparison(*operands), dtype=np.float64)


OF_NUMPY = (
    *("sqrt", "hypot", "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh"),
    *("sign", "copysign", "floor", "ceil", "fmod"),
)
"""Operations that numpy calls as CasADi does."""
OPERATIONS: dict[int, Operation] = {getattr(ca, f"OP_{name.upper()}"): getattr(np, name) for name in OF_NUMPY} | {
    ca.OP_ASSIGN: operator.pos,
    ca.OP_ADD: operator.add,
    ca.OP_SUB: operator.sub,
    ca.OP_MUL: operator.mul,
    ca.OP_DIV: operator.truediv,
    ca.OP_NEG: operator.neg,
    ca.OP_INV: np.reciprocal,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_SQ: np.square,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_ASINH: np.arcsinh,
    ca.OP_ACOSH: np.arccosh,
    ca.OP_ATANH: np.arctanh,
    ca.OP_ERF: special.erf,
    ca.OP_FABS: np.abs,
    ca.OP_REMAINDER: lambda a, b: a - b * np.rint(a / b),
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


class _Kind(Enum):
    """What an instruction does; its operands are registers, or row and input."""

    CONSTANT = auto()
    VARIABLE = auto()
    PARAMETER = auto()
    UNARY = auto()
    BINARY = auto()
    OUTPUT = auto()


class VectorisedFunction:
    """A column `output` as a function of columns of inputs and of parameters that all samples share, and its derivatives."""

    def __init__(self, inputs: Sequence[Any], p: Any, output: Any, by: Any = None) -> None:
        """Take the instructions of the expression; derivatives are `by` the first input and p by default.

        Raises `UnsupportedOperationError`.
        """
        self._jacobian_of = inputs, p, output, ca.vertcat(inputs[0], p) if by is None else by
        function = ca.Function("output", [*inputs, p], [ca.densify(output)])
        self.rows = output.numel()
        self._n_registers = function.sz_w()
        self._instructions = [
            _read_instruction(function, i, parameter_input=len(inputs)) for i in range(function.n_instructions())
        ]

    def __call__(self, inputs: Sequence[Array], p: Array) -> Array:
        """Return the outputs (n, rows) for inputs of shape (rows, n) or (n,)."""
        columns = [np.atleast_2d(each) for each in inputs]
        count = columns[0].shape[1]
        output = np.empty((self.rows, count))
        for first in range(0, count, COLUMNS_AT_ONCE):
            part = slice(first, first + COLUMNS_AT_ONCE)
            with np.errstate(all="ignore"):  # parameters that diverge give numbers that are not finite
                self._run([each[:, part] for each in columns], p, output[:, part])
        return output.T

    @cached_property
    def jacobian(self) -> "VectorisedJacobian":
        """The derivatives, for the same arguments. Raises `UnsupportedOperationError`."""
        return VectorisedJacobian(*self._jacobian_of)

    def _run(self, columns: list[Array], p: Array, output: Array) -> None:
        registers: list[Any] = [0.0] * self._n_registers
        for kind, operation, to, first, second in self._instructions:
            if kind is _Kind.BINARY:
                registers[to] = operation(registers[first], registers[second])
            elif kind is _Kind.UNARY:
                registers[to] = operation(registers[first])
            elif kind is _Kind.OUTPUT:
                output[to] = registers[first]
            elif kind is _Kind.VARIABLE:
                registers[to] = columns[first][second]
            elif kind is _Kind.PARAMETER:
                registers[to] = p[second]
            else:
                registers[to] = operation


def _read_instruction(function: Any, i: int, parameter_input: int) -> tuple[_Kind, Any, int, int, int]:
    """Return kind, operation or constant, the register or row that it sets, and two operands."""
    operator_of, to, of = function.instruction_id(i), function.instruction_output(i), function.instruction_input(i)
    if operator_of == ca.OP_CONST:
        # A constant is a number of numpy, so that a division of two constants by zero is not an error.
        return _Kind.CONSTANT, np.float64(function.instruction_constant(i)), to[0], 0, 0
    if operator_of == ca.OP_INPUT:
        return _Kind.PARAMETER if of[0] == parameter_input else _Kind.VARIABLE, None, to[0], of[0], of[1]
    if operator_of == ca.OP_OUTPUT:
        return _Kind.OUTPUT, None, to[1], of[0], 0
    if operator_of not in OPERATIONS:
        raise UnsupportedOperationError(operator_of)
    kind = _Kind.BINARY if len(of) == 2 else _Kind.UNARY
    return kind, OPERATIONS[operator_of], to[0], of[0], of[-1]


class VectorisedJacobian:
    """A sparse Jacobian for many samples, in dense arrays."""

    def __init__(self, inputs: Sequence[Any], p: Any, output: Any, by: Any) -> None:
        """Differentiate `output` by `by`. Raises `UnsupportedOperationError`."""
        jacobian = ca.jacobian(output, by)
        self.shape: tuple[int, int] = jacobian.shape
        rows, columns = jacobian.sparsity().get_triplet()
        self._entry_indices = np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)
        self._entries = VectorisedFunction(inputs, p, ca.vertcat(ca.SX(0, 1), *jacobian.nonzeros()))

    def __call__(self, inputs: Sequence[Array], p: Array) -> Array:
        """Return the Jacobians, shape (n, outputs, variables)."""
        entries = self._entries(inputs, p)
        jacobians = np.zeros((len(entries), *self.shape))
        jacobians[:, self._entry_indices[0], self._entry_indices[1]] = entries
        return jacobians
