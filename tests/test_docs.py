"""The docs say what the code does."""

import re
from pathlib import Path

import pytest

from gateway.topics import TOPICS
from gateway.verbs import VERBS
from tests.generated_docs import DOCS, PAGES

ROOT = Path(__file__).parents[1]
ROOMS = ("guides", "reference", "evidence", "development")


def test_topic_table_is_the_codes() -> None:
    text = (ROOT / "docs" / "reference" / "messages.md").read_text()
    rows = re.findall(
        r"^\| (\w+) \| ((?:plumbline|foxglove)\.\w+) \| (.+?) \| (yes|no) \| (yes|no) \|$", text, re.MULTILINE
    )
    yes = {True: "yes", False: "no"}
    assert rows == [
        (topic.name, topic.schema_name, topic.rate, yes[topic.logged], yes[topic.published])
        for topic in TOPICS.values()
    ]


def pages() -> list[Path]:
    """Return all pages: those of the documentation, of the root, and the read-me files beside code and data."""
    below = [path for top in ("config", "deploy", "docs", "script", "tests") for path in (ROOT / top).rglob("*.md")]
    return [*ROOT.glob("*.md"), *below]


def without_code(page: Path) -> str:
    """Return the text of a page without its blocks and spans of code, in which brackets are no links."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^ {4,}.*$", "", text, flags=re.MULTILINE))


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings by the rule of GitHub: lower case, hyphens for blanks, numbers for repetitions."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    found: list[str] = []
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        shown = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        found.append(re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-"))
    return {
        name if not found[:place].count(name) else f"{name}-{found[:place].count(name)}"
        for place, name in enumerate(found)
    }


@pytest.mark.slow
def test_the_table_of_verbs_has_all_of_them() -> None:
    rows = re.findall(r"^\| ([a-z_, ]+) \|", (DOCS / "reference" / "requests.md").read_text(), re.MULTILINE)
    assert VERBS.keys() <= {name for row in rows for name in row.split(", ")}


def test_every_relative_link_leads_to_a_file_and_a_heading() -> None:
    broken = []
    for page in pages():
        for target, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)", without_code(page)):
            if re.match(r"[a-z]+:", target):
                continue
            path = (page.parent / target) if target else page
            if not path.exists() or (anchor and anchor not in anchors(path)):
                broken.append(f"{page.relative_to(ROOT)}: {target}#{anchor}")
    assert broken == []


def test_every_page_stands_in_a_room() -> None:
    """A page is for users, exact reference, evidence, or for those who change the code, and the folder says which."""
    outside = [path for path in DOCS.rglob("*") if path.is_file() and path.relative_to(DOCS).parts[0] not in ROOMS]
    assert outside == [DOCS / "README.md"]
    for guide in (DOCS / "guides").iterdir():
        assert (guide / "README.md").is_file(), f"{guide.name} has no page to start with"


@pytest.mark.slow
def test_every_page_is_reached_from_the_first_one() -> None:
    """Whoever opens docs/README.md finds every page by links between pages."""
    reached: set[Path] = set()
    waiting = [DOCS / "README.md"]
    while waiting:
        page = waiting.pop().resolve()
        if page not in reached and page.suffix == ".md" and page.is_relative_to(DOCS):
            reached.add(page)
            targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)\s]*)?\)", page.read_text())
            waiting += [page.parent / target for target in targets if not re.match(r"[a-z]+:", target)]
    assert set(DOCS.rglob("*.md")) - reached == set()


def test_every_path_that_the_docs_name_exists() -> None:
    for page in [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]:
        named = re.findall(r"`((?:config|deploy|docs|script|tests)/[\w./-]+)`", page.read_text())
        assert [name for name in named if not (ROOT / name).exists()] == [], page


def test_every_test_that_the_docs_name_exists() -> None:
    present = [path.with_suffix("").as_posix() for path in (ROOT / "tests").rglob("test_*.py")]
    named = {
        (page.relative_to(ROOT), name.removesuffix(".py"))
        for page in DOCS.rglob("*.md")
        for name in re.findall(r"`((?:[\w.-]+/)*test_\w+(?:\.py)?)`", page.read_text())
    }
    assert {(page, name) for page, name in named if not any(path.endswith(f"/{name}") for path in present)} == set()
    assert len(named) > 30


def test_every_package_that_the_docs_name_exists() -> None:
    for page in [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]:
        named = re.findall(r"`((?:gateway|devices|tests)(?:\.\w+)*)`", page.read_text())
        paths = [ROOT / name.replace(".", "/") for name in named]
        assert [str(path) for path in paths if not path.is_dir() and not path.with_suffix(".py").exists()] == [], page


@pytest.mark.slow
def test_every_cited_source_is_in_the_references() -> None:
    listed = (DOCS / "reference" / "references.md").read_text().splitlines()
    code = [path for top in ("gateway", "devices") for path in (ROOT / top).rglob("*.py")]
    for path in [*code, *ROOT.glob("*.md"), *DOCS.rglob("*.md")]:
        cited = re.findall(r"\b([A-ZŁ]\w+)(?: et al\.| and others)?,? ((?:19|20)\d\d)\b(?!-)", path.read_text())
        missing = [(name, year) for name, year in cited if not any(name in row and year in row for row in listed)]
        assert missing == [], path


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_generated_page_is_up_to_date(name: str) -> None:
    assert (DOCS / name).read_text() == PAGES[name](), "run script/docs"
