"""Breaks an equation in the source: sign, factor, argument, function, exchanged axis, branch or comparison."""

import ast
import re
from collections.abc import Iterator

Change = tuple[ast.AST, str, object]
"""Node, attribute and the value that it gets."""
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.Gt,
    ast.Gt: ast.Lt,
    ast.LtE: ast.GtE,
    ast.GtE: ast.LtE,
}
FUNCTIONS = {
    "sin": "cos", "cos": "sin", "tan": "sin", "arcsin": "arctan", "arccos": "arcsin", "acos": "asin", "asin": "atan",
    "arctan": "sin", "atan": "sin", "exp": "expm1", "log": "log1p", "min": "max", "max": "min", "argmax": "argmin",
    "argmin": "argmax",
}  # fmt: skip
"""Functions by name, with those that take their place."""
EXCHANGED = ("arctan2", "atan2", "copysign")
"""Functions whose two arguments are exchanged."""
FACTOR = 1.07
"""Factor on a number: that by which the printed eq. 26 of Zhu et al. 2020 is wrong."""


def mutants(source: str, name: str, numbers: list[int]) -> list[tuple[str, str]]:
    """Return what is broken in a definition and the private functions that it calls, and the source with it.

    Where lines state "# eq. 18-19" of these numbers, those alone are broken.
    """
    marked = {line for line, text in enumerate(source.splitlines(), start=1) if _states(text, numbers)}
    count = len(list(_changes(ast.parse(source), name)))
    found = []
    for number in range(count):
        tree = ast.parse(source)
        text, line, (node, attribute, value) = list(_changes(tree, name))[number]
        setattr(node, attribute, value)
        found.append((line, f"line {line}: {text}", ast.unparse(ast.fix_missing_locations(tree))))
    kept = [one for one in found if one[0] in marked] or found
    return [(text, changed) for _, text, changed in kept]


def _states(line: str, numbers: list[int]) -> bool:
    stated = re.search(r"# eq\. (\d+)(?:-(\d+))?", line)
    if stated is None:
        return False
    low, high = int(stated[1]), int(stated[2] or stated[1])
    return any(low <= number <= high for number in numbers)


def _definitions(tree: ast.Module, name: str) -> list[ast.stmt]:
    """Return the statement that defines a name, such as `Correction.apply`, and the private functions that it calls.

    Raises `LookupError` without one.
    """
    body, found = tree.body, None
    for part in name.split("."):
        found = next((one for one in body if _defines(one, part)), None)
        if found is None:
            raise LookupError(name)
        body = getattr(found, "body", [])
    if found is None:
        raise LookupError(name)
    called = {
        node.func.id for node in ast.walk(found) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    private = [
        one for one in tree.body if isinstance(one, ast.FunctionDef) and one.name in called and one.name[0] == "_"
    ]
    return [found, *private]


def _defines(statement: ast.stmt, name: str) -> bool:
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return statement.name == name
    targets = statement.targets if isinstance(statement, ast.Assign) else []
    return any(isinstance(target, ast.Name) and target.id == name for target in targets)


def _changes(tree: ast.Module, name: str) -> Iterator[tuple[str, int, Change]]:
    for root in _definitions(tree, name):
        for node in _expressions(root):
            for text, change in _ways(node):
                yield text, getattr(node, "lineno", root.lineno), change


def _ways(node: ast.AST) -> Iterator[tuple[str, Change]]:
    """Yield the ways to break one node."""
    match node:
        case ast.BinOp(op=operator) | ast.AugAssign(op=operator) if type(operator) in OPERATORS:
            other = OPERATORS[type(operator)]
            yield f"{type(operator).__name__} by {other.__name__}", (node, "op", other())
        case ast.BinOp(op=ast.Pow(), right=ast.Constant(value=int(power))):
            yield "a power", (node, "right", ast.Constant(power + 1))
        case ast.BinOp(op=ast.MatMult(), right=ast.Attribute(attr="T", value=matrix)):
            yield "a transpose", (node, "right", matrix)
        case ast.UnaryOp(op=ast.USub()):
            yield "a sign", (node, "op", ast.UAdd())
        case ast.IfExp(body=body, orelse=otherwise):
            yield "always the first branch", (node, "orelse", body)
            yield "always the second branch", (node, "body", otherwise)
        case ast.Call(func=ast.Attribute() as function):
            yield from _ways_of_call(node, function)
        case ast.Compare(ops=[comparison]) if type(comparison) in COMPARISONS:
            yield "a comparison", (node, "ops", [COMPARISONS[type(comparison)]()])
        case ast.Constant(value=float(value)) if value != 0:
            yield f"{value:g} times {FACTOR}", (node, "value", value * FACTOR)


def _ways_of_call(node: ast.Call, function: ast.Attribute) -> Iterator[tuple[str, Change]]:
    match function.attr, node.args:
        case called, [one, another] if called in EXCHANGED:
            yield f"arguments of {called}", (node, "args", [another, one])
        case "hypot", [one, another]:
            yield "the second argument of hypot", (node, "args", [one, one])
            yield "the first argument of hypot", (node, "args", [another, another])
        case called, _ if called in FUNCTIONS:
            yield f"{called} by {FUNCTIONS[called]}", (function, "attr", FUNCTIONS[called])


def _expressions(root: ast.stmt) -> Iterator[ast.AST]:
    """Yield the nodes that compute; not those of refusals, messages, annotations and defaults."""
    stack: list[ast.AST] = [root]
    while stack:
        node = stack.pop()
        yield node
        match node:
            case ast.FunctionDef(body=body):
                children: list[ast.AST] = list(body)
            case ast.AnnAssign(value=value):
                children = [] if value is None else [value]
            case _:
                children = list(ast.iter_child_nodes(node))
        stack.extend(child for child in reversed(children) if not isinstance(child, ast.Raise | ast.JoinedStr))
