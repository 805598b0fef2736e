"""Tuned numbers state their basis: the count of those that do not may only fall.

A tuned number is a module constant in capitals, alone or in a tuple, whose value has a number. Left out is what is structural:
the integers 0, 1 and 2, and 0.0; numbers written in another base than ten (registers, masks); powers of ten as a factor, and
names of two units (`NS_PER_S`, `DAY_S`), which convert; indices, and arguments of `range`, `slice` and `datetime`; keys of
tables; and names that end in VERSION, PORT or CODE.

A basis stands in the docstring below the constant: "Basis: ...", "Definition: ...", or a source, which is a paper with its year,
a standard with its number, or a data sheet with its table or section.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CHECKED_ELSEWHERE = ("gateway/motion/", "gateway/swing/", "gateway/twin/reconcile/")
"""Folders whose numbers the benchmarks move."""
WITHOUT_BASIS = 72
"""Tuned numbers without a basis. Lower it with every basis; never raise it."""

CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")
STRUCTURAL_NAME = re.compile(r"(.*_)?(VERSION|PORT|CODE)")
UNIT = "NS|US|MS|S|SECONDS?|MINUTES?|HOURS?|DAYS?|WEEKS?|MM|M|G|MG|DEG|RAD|BITS?|BYTES?|V|MV|UV|MB"
CONVERSION_NAME = re.compile(rf"_?(({UNIT})_PER_({UNIT})|(MINUTE|HOUR|DAY)_(S|MS|NS))")
BASIS = re.compile(
    r"[Bb]asis:|Definition:|\b[Dd]ata sheets?\b"
    r"|(\bet al\.|\b[A-ZŁ]\w+),? ((19|20)\d\d\b|n\.d\.)|\bGUM\b"
    r"|\b([Tt]able|[Ss]ection|eq\.) \d|\b(IEC|ISO|IEEE|RFC|EN|DIN|NIST|JCGM|ITU)[ -]?(SP )?\d"
)
FACTORS = (ast.Mult, ast.Div, ast.FloorDiv, ast.Pow)


def is_power_of_ten(value: float) -> bool:
    """Return whether a number is 10, 100, 1e9, 1e-3 or the like."""
    return value > 0 and f"{value:e}".rstrip("0123456789+-").rstrip("e").rstrip("0") == "1."


def tuned_literals(node: ast.AST, lines: list[bytes], factor: bool = False) -> Iterator[float]:
    """Yield the numbers of an expression that are not structural."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            other_base = lines[node.lineno - 1][node.col_offset :][:2].lower() in {b"0x", b"0b", b"0o"}
            structural = (
                value == 0 or (isinstance(value, int) and value in {1, 2}) or (factor and is_power_of_ten(value))
            )
            if not other_base and not structural:
                yield value
        case ast.Call(func=ast.Name(id="range" | "datetime" | "slice")):
            return
        case ast.Subscript(value=inner):
            yield from tuned_literals(inner, lines)
        case ast.BinOp(op=op):
            for side in (node.left, node.right):
                yield from tuned_literals(side, lines, isinstance(op, FACTORS))
        case ast.Dict(values=entries):
            for entry in entries:
                yield from tuned_literals(entry, lines)
        case _:
            for child in ast.iter_child_nodes(node):
                yield from tuned_literals(child, lines)


def constants(statement: ast.stmt) -> list[str]:
    """Return the names in capitals to which a statement assigns."""
    match statement:
        case ast.Assign(targets=targets):
            pass
        case ast.AnnAssign(target=target, value=ast.expr()):
            targets = [target]
        case _:
            return []
    names = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
    return [name for name in names if CONSTANT.fullmatch(name)]


def docstring_below(statements: list[ast.stmt], place: int) -> str:
    """Return the docstring below a statement on one line, or an empty text."""
    match statements[place + 1 : place + 2]:
        case [ast.Expr(value=ast.Constant(value=str() as text))]:
            return " ".join(text.split())
    return ""


def without_basis(source: str) -> list[str]:
    """Return the names of the tuned numbers of a module that state no basis; those of one tuple are one entry."""
    statements, lines = ast.parse(source).body, source.encode().splitlines()
    found = []
    for place, statement in enumerate(statements):
        names = constants(statement)
        if not names or all(STRUCTURAL_NAME.fullmatch(name) or CONVERSION_NAME.fullmatch(name) for name in names):
            continue
        assert isinstance(statement, ast.Assign | ast.AnnAssign)
        assert statement.value is not None
        if any(tuned_literals(statement.value, lines)) and not BASIS.search(docstring_below(statements, place)):
            found.append(", ".join(names))
    return found


def test_a_number_without_a_basis_is_found() -> None:
    assert without_basis("LIMIT_S = 3.0\nA, _B = 0.5, 0\nTABLE: dict[int, float] = {3: 0.25}\n") == [
        "LIMIT_S",
        "A, _B",
        "TABLE",
    ]
    assert without_basis('LIMIT_S = 3.0\n"""Longest wait, s."""\n') == ["LIMIT_S"]


def test_a_basis_is_a_reason_a_definition_or_a_source() -> None:
    bases = [
        "Basis: a swing.",
        "Definition: a day.",
        "(Zhu et al. 2020, eq. 2)",
        "sRGB, IEC 61966-2-1",
        "Data sheet, table 3.",
    ]
    assert [without_basis(f'LIMIT = 3.5\n"""Limit. {basis}"""\n') for basis in bases] == [[]] * len(bases)


def test_structural_numbers_need_no_basis() -> None:
    structural = [
        "FIFO = 0x2D", "AXES = tuple(range(3))", "LAST = NAMES[:5]", "NS_PER_S = 1_000_000_000", "DAY_S = 86_400.0",
        "WAIT_NS = int(WAIT_S * 1e9)",
        "CREATED = datetime(2000, 1, 1)", "FORMAT_VERSION = 7", "ROOM = {4: 'a'}", "HALF = 1 / 2", "lower = 3.5",
    ]  # fmt: skip
    assert [without_basis(line + "\n") for line in structural] == [[]] * len(structural)


@pytest.mark.slow
def test_the_count_of_numbers_without_a_basis_only_falls() -> None:
    paths = sorted(path for folder in ("gateway", "devices") for path in (ROOT / folder).rglob("*.py"))
    places = [(path, path.relative_to(ROOT).as_posix()) for path in paths]
    found = [
        f"{place}: {names}"
        for path, place in places
        if not place.startswith(CHECKED_ELSEWHERE)
        for names in without_basis(path.read_text(encoding="utf-8"))
    ]
    assert len(found) <= WITHOUT_BASIS, "state a basis below the new one of:\n" + "\n".join(found)
    assert len(found) == WITHOUT_BASIS, f"lower WITHOUT_BASIS of {Path(__file__).name} to {len(found)}"
