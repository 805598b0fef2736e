"""The glossary and the list of references agree with each other."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def table_rows(page: Path) -> list[list[str]]:
    """Cells of every table row of a page, without the rows of the header."""
    rows = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip("|"))]
        for line in page.read_text().splitlines()
        if line.startswith("| ")
    ]
    return [row for row in rows if row[0] not in ("term", "key", "in code")]


def test_every_term_has_a_meaning_of_one_sentence() -> None:
    rows = table_rows(DOCS / "glossary.md")
    assert 100 <= len(rows) <= 130
    assert [row[0] for row in rows if len(row) != 4 or not row[1].endswith(".") or ". " in row[1]] == []


def test_every_term_is_defined_once() -> None:
    names = [
        name.strip() for row in table_rows(DOCS / "glossary.md") for name in re.split(r", | \(|\)", row[0]) if name
    ]
    assert [name for name in set(names) if names.count(name) > 1] == []


def test_every_source_of_a_term_is_in_the_references() -> None:
    keys = [row[0] for row in table_rows(DOCS / "references.md")]
    sources = {source for row in table_rows(DOCS / "glossary.md") for source in row[3].split(", ")} - {"Plumbline"}
    # "VIM 2.30" cites an entry of "VIM"; a number alone continues the source before it
    unknown = [
        source for source in sources if source not in keys and re.sub(r" ?[\d.]+$", "", source) not in (*keys, "")
    ]
    assert unknown == []
