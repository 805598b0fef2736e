"""The glossary, the references and the names of modules agree with each other."""

import re
from collections.abc import Iterator
from pathlib import Path

from gateway.configuration.device_sections import DEVICE_SECTIONS

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "docs" / "reference"


def tables(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield every row of the tables of a page, behind the first cell of its table's header."""
    header = None
    for line in page.read_text().splitlines():
        if not line.startswith("|"):
            header = None
            continue
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip("|"))]
        if header is None:
            header = cells[0]
        elif set(line) != set("|-"):
            yield header, cells


def rows(page: str, header: str) -> list[list[str]]:
    """Return the rows of those tables of a page that begin with a column."""
    return [cells for name, cells in tables(REFERENCE / page) if name == header]


def words(text: str) -> set[str]:
    """Return the words of a name or term in the singular and in lower case."""
    return {singular(word) for word in re.findall(r"[^\W_]+", text.lower())}


def singular(word: str) -> str:
    """Return the singular of a regular plural, and of "hypotheses"."""
    if word.endswith("theses"):
        return word[:-2] + "is"
    if word.endswith("ies"):
        return word[:-3] + "y"
    if word.endswith(("ches", "sses", "xes")):
        return word[:-2]
    return word[:-1] if word.endswith("s") and not word.endswith(("ss", "us", "is")) else word


COMMON_WORDS = words(
    """
    connection sentence shutdown start stop disk job regular chunk stated value
    angle application argument array backoff bounded buffer builder cache change check CLI client command config configuration
    context counter daemon data dependency description detail doctor document drawing environment error export factory figures
    file finder first folder follow format formatting function handler history hub inbox info input instance interrupt JSON
    launch limiter link loading log main make manager markup MCAP mean method metric nominal notify option optional outgoing
    output packing page palette PDF plot plugin port pre procedure process processor progress provider publisher queue rate
    reader reference registry remaining render report resource result RPC run sampler schema serial serialisation server
    service shape size source state status step store stretch style table text type unit vector view word worker
    writer zoom I2C WitMotion chip identity section
    analogue part probe recovery self test expected watch column layout notation MATLAB parallel
    exposition protocol latest setting runtime sampling storage native
    completion analysis machine terminal language supervision extras operator alternative content
    """
)
"""Words of computing and everyday English, and names of parts; every other word of a module name is a term of the glossary."""


def module_words() -> dict[str, str]:
    """Return the words of all module and package names, each with a file in whose path it occurs."""
    found: dict[str, str] = {}
    for top in ("gateway", "devices"):
        for path in sorted((ROOT / top).rglob("*.py")):
            place = path.relative_to(ROOT)
            for name in place.with_suffix("").parts:
                found |= {word: str(place) for word in words(name) if not name.startswith("__")}
    return found


def test_every_term_has_a_meaning_of_one_sentence() -> None:
    terms = rows("glossary.md", "term")
    assert len(terms) >= 100
    assert [row[0] for row in terms if len(row) != 4 or not row[1].endswith(".") or ". " in row[1]] == []


def test_every_term_is_defined_once() -> None:
    names = [
        name.strip() for row in rows("glossary.md", "term") for name in re.split(r", | \(|\)", row[0]) if name.strip()
    ]
    assert [name for name in set(names) if names.count(name) > 1] == []


def test_every_source_of_a_term_is_in_the_references() -> None:
    keys = [row[0] for row in rows("references.md", "key")]
    sources = {source for row in rows("glossary.md", "term") for source in row[3].split(", ")} - {"Plumbline"}
    # "VIM 2.30" cites an entry of "VIM"; a number alone continues the source before it
    unknown = [
        source for source in sources if source not in keys and re.sub(r" ?[\d.]+$", "", source) not in (*keys, "")
    ]
    assert unknown == []


def test_every_word_of_a_module_name_is_a_term() -> None:
    cells = rows("glossary.md", "term") + rows("glossary.md", "in code")
    terms = set().union(*(words(row[0]) for row in cells))
    unknown = {
        word: place
        for word, place in module_words().items()
        if word not in terms | COMMON_WORDS | words(" ".join(DEVICE_SECTIONS))
    }
    assert unknown == {}, "enter the term in docs/reference/glossary.md, or an everyday word in COMMON_WORDS"


def test_every_class_name_has_one_meaning() -> None:
    places: dict[str, list[str]] = {}
    for package in ("gateway", "devices"):
        for path in sorted((ROOT / package).rglob("*.py")):
            for name in re.findall(r"^class (\w+)", path.read_text(), flags=re.M):
                places.setdefault(name, []).append(str(path.relative_to(ROOT)))
    public = {name: found for name, found in places.items() if len(found) > 1 and not name.startswith("_")}
    assert public == {}
