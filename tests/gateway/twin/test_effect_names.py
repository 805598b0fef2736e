"""Only the vocabulary knows effects by their names."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.twin.effects import EFFECTS

GATEWAY = Path(__file__).parents[3] / "gateway"
OTHER_MEANINGS = {
    "messages/": "causes of a condition, as the gateway recognises them live",
    "stages/condition": "the same causes",
    "motion/": "states of the motion, as the gateway publishes them",
    "pipeline/motion": "the same states",
    "measurement/motion": "the same states",
    "page/": "the same states, as the page shows them",
    "incident/": "the same states, in the report of an incident",
}
"""Places in which an effect's name means something else, with the reason."""


def literals(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the string literals of a file that are not docstrings, with their lines."""
    tree = ast.parse(path.read_text())
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.lineno, node.value


@pytest.mark.slow
def test_no_effect_name_is_a_literal_outside_the_vocabulary() -> None:
    found = []
    for path in sorted(GATEWAY.rglob("*.py")):
        place = str(path.relative_to(GATEWAY))
        if place.startswith(("twin/effects/", *OTHER_MEANINGS)):
            continue
        for line, text in literals(path):
            name = text.partition(".")[0].partition("[")[0].partition(":")[0]
            if name in EFFECTS:
                found.append(f"{place}:{line}: {text}")
    assert found == []
