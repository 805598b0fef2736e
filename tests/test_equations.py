"""The table of the papers' equations is complete, and every name and every test in it exists.

`script/mutate` shows that the tests are those of the equations.
"""

import re
from importlib import import_module
from operator import attrgetter
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "equations.md"
NUMBERS = {
    "Łuczak et al. 2022": range(1, 26),
    "Łuczak n.d.": range(1, 37),
    "Zhu et al. 2020": range(1, 27),
    "Zams and Łuczak 2024": range(1, 9),
    "Sawicki and Walendziuk 2016": range(1, 11),
}
"""The numbered equations of each paper."""
NAME = re.compile(r"`([\w.]+):([\w.]+)`")
"""Module and name in the column of the code."""


def sections() -> dict[str, list[list[str]]]:
    """Return the rows of the table of each paper: numbers, content, code, test, erratum."""
    parts = re.split(r"^## (.+)$", PAGE.read_text(), flags=re.MULTILINE)[1:]
    return {
        title: [
            [cell.strip() for cell in line.strip("|").split("|")]
            for line in text.splitlines()
            if re.match(r"\| \d", line)
        ]
        for title, text in zip(parts[::2], parts[1::2], strict=True)
    }


def expanded(cell: str) -> list[int]:
    """Return the numbers of a cell such as "1", "1, 2" or "4 to 9"."""
    if found := re.fullmatch(r"(\d+) to (\d+)", cell):
        return list(range(int(found[1]), int(found[2]) + 1))
    return [int(number) for number in cell.split(", ")]


@pytest.mark.parametrize("paper", NUMBERS)
def test_every_numbered_equation_stands_once_in_the_table(paper: str) -> None:
    found = [number for row in sections()[paper] for number in expanded(row[0])]
    assert found == list(NUMBERS[paper])


def test_no_paper_is_missing() -> None:
    assert list(sections()) == list(NUMBERS)


@pytest.mark.parametrize("paper", NUMBERS)
def test_every_row_names_code_that_exists_and_states_an_erratum_or_none(paper: str) -> None:
    for numbers, content, code, test, erratum in sections()[paper]:
        assert content, numbers
        assert erratum == "—" or erratum.endswith("."), numbers
        names = NAME.findall(code)
        assert names, numbers
        for module, name in names:
            assert attrgetter(name)(import_module(module)) is not None, name
        for path in test.replace("`", "").split(", "):
            assert (PAGE.parents[2] / path).is_file(), path
