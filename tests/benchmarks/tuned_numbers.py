"""Find the tuned numbers of modules in their source, and import a module with one of them moved.

A tuned number is a number, or an element of a tuple of numbers, that a module assigns to a name in capitals, or a default of a
field of a dataclass whose name ends in "Settings". Its docstring stands below it. One whose docstring has the word "Definition:"
follows from a definition (a count, a formula, a standard) and is not tuned.
"""

import ast
import importlib
import importlib.util
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from numbers import Real
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, TypeGuard

DEFINITION = "Definition:"
BASIS = "Basis:"
SETTINGS = "Settings"


@dataclass(frozen=True, slots=True)
class TunedNumber:
    """A number in the source of a module."""

    module: str
    name: str
    """`NAME`, or `Class.field` of settings."""
    element: int | None
    """Place in a tuple."""
    value: float
    docstring: str

    @property
    def label(self) -> str:
        """The name with its module and place."""
        place = "" if self.element is None else f"[{self.element}]"
        return f"{self.module}.{self.name}{place}"

    @property
    def meaning(self) -> str:
        """The docstring before its basis, on one line."""
        return " ".join(self.docstring.split(BASIS)[0].split())

    @property
    def basis(self) -> str:
        """Why it has this value; empty where the docstring does not say."""
        return " ".join(self.docstring.partition(BASIS)[2].split())


def find_tuned_numbers(packages: Iterable[str]) -> list[TunedNumber]:
    """Return the tuned numbers of modules and of all modules inside packages, in the order of their source."""
    return [
        number for package in packages for name in _module_names(package) for number in _of_module(name) if number.value
    ]


def _module_names(package: str) -> list[str]:
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise ValueError(f"no module {package}")
    if spec.submodule_search_locations is None:
        return [package]
    root = Path(spec.origin).parent
    paths = sorted(root.rglob("*.py"))
    inside = [path.relative_to(root).with_suffix("").parts for path in paths]
    return [".".join([package, *(part for part in parts if part != "__init__")]) for parts in inside]


def _of_module(name: str) -> Iterator[TunedNumber]:
    module = importlib.import_module(name)
    source = Path(str(module.__file__)).read_text(encoding="utf-8")
    for owner, statement, docstring in _assignments(ast.parse(source)):
        if DEFINITION in docstring:
            continue
        for target in _targets(statement):
            holder: Any = module if owner is None else getattr(module, owner)
            label = target if owner is None else f"{owner}.{target}"
            value = _default(holder, target)
            if isinstance(value, tuple):
                for element, each in enumerate(value):
                    if _is_number(each):
                        yield TunedNumber(name, label, element, float(each), docstring)
            elif _is_number(value):
                yield TunedNumber(name, label, None, float(value), docstring)


def _default(holder: ModuleType | type, name: str) -> Any:
    fields = getattr(holder, "__dataclass_fields__", None)
    return getattr(holder, name) if fields is None else fields[name].default


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _assignments(tree: ast.Module) -> Iterator[tuple[str | None, ast.Assign | ast.AnnAssign, str]]:
    """Yield the class that holds an assignment (None: the module), the assignment, and the docstring below it."""
    bodies: list[tuple[str | None, Sequence[ast.stmt]]] = [(None, tree.body)]
    bodies += [(node.name, node.body) for node in tree.body if _is_settings(node)]
    for owner, body in bodies:
        for place, statement in enumerate(body):
            if (
                isinstance(statement, ast.Assign | ast.AnnAssign)
                and statement.value is not None
                and _targets(statement)
            ):
                following = body[place + 1] if place + 1 < len(body) else None
                yield owner, statement, _docstring(following)


def _is_settings(node: ast.stmt) -> TypeGuard[ast.ClassDef]:
    return isinstance(node, ast.ClassDef) and node.name.endswith(SETTINGS)


def _docstring(node: ast.stmt | None) -> str:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return node.value.value
    return ""


def _targets(statement: ast.Assign | ast.AnnAssign) -> list[str]:
    """Return the names that an assignment gives a value: of constants in capitals, of fields any."""
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    flat = [each for target in targets for each in (target.elts if isinstance(target, ast.Tuple) else [target])]
    names = [each.id for each in flat if isinstance(each, ast.Name)]
    return [name for name in names if isinstance(statement, ast.AnnAssign) or name == name.upper()]


def moved(value: Any, factor: float, element: int | None = None) -> Any:
    """Return a number, or a tuple of numbers with one of them, times a factor; a whole number moves by 1 at least."""
    if element is not None:
        return tuple(moved(each, factor) if place == element else each for place, each in enumerate(value))
    if isinstance(value, int):
        scaled = round(value * factor)
        return scaled if scaled != value else value + (1 if factor > 1 else -1)
    return value * factor


class _Mover(ast.NodeTransformer):
    """Wraps the value of one assignment in a call of `moved`."""

    def __init__(self, number: TunedNumber, factor: float) -> None:
        owner, _, name = number.name.rpartition(".")
        self._owner, self._name, self._number, self._factor = owner, name, number, factor
        self.done = False

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        return self.generic_visit(node) if node.name == self._owner else node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        return node

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        return self._wrapped(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        return self._wrapped(node)

    def _wrapped(self, node: ast.Assign | ast.AnnAssign) -> ast.AST:
        names = _targets(node)
        if self._name not in names or node.value is None:
            return node
        element = names.index(self._name) if len(names) > 1 else self._number.element
        call = f"__import__({__name__!r}, fromlist=['moved']).moved(None, {self._factor!r}, {element!r})"
        wrapped = ast.parse(call, mode="eval").body
        assert isinstance(wrapped, ast.Call)
        wrapped.args[0] = node.value
        node.value = wrapped
        self.done = True
        return ast.fix_missing_locations(node)


class _MovingLoader(SourceFileLoader):
    def __init__(self, name: str, path: str, number: TunedNumber, factor: float) -> None:
        super().__init__(name, path)
        self._mover = _Mover(number, factor)

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        tree = self._mover.visit(ast.parse(self.get_data(path)))
        if not self._mover.done:
            raise ImportError(f"{fullname} does not assign {self._mover._name}")
        code: CodeType = compile(tree, path, "exec", dont_inherit=True)
        return code


class _MovingFinder(MetaPathFinder):
    def __init__(self, number: TunedNumber, factor: float) -> None:
        self._number, self._factor = number, factor

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != self._number.module:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.origin is not None:
            spec.loader = _MovingLoader(fullname, spec.origin, self._number, self._factor)
        return spec


def move_on_import(number: TunedNumber, factor: float, top: str = "gateway") -> None:
    """Forget all modules of a package, and import them from now on with one number moved.

    The number is moved where it is assigned; so are its copies in other modules, defaults of arguments and what derives from it.
    """
    for name in [name for name in sys.modules if name == top or name.startswith(f"{top}.")]:
        del sys.modules[name]
    sys.meta_path.insert(0, _MovingFinder(number, factor))
