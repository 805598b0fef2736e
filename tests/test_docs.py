"""The docs say what the code does."""

import re
from pathlib import Path

import pytest

from gateway.cli.main import parser
from gateway.topics import TOPICS
from tests.command_lines import command_words
from tests.generated_docs import DOCS, PAGES

ROOT = Path(__file__).parents[1]


def test_topic_table_is_the_codes() -> None:
    text = (ROOT / "docs" / "development" / "architecture.md").read_text()
    rows = re.findall(
        r"^\| (\w+) \| ((?:plumbline|foxglove)\.\w+) \| (.+?) \| (yes|no) \| (yes|no) \|$", text, re.MULTILINE
    )
    yes = {True: "yes", False: "no"}
    assert rows == [
        (topic.name, topic.schema_name, topic.rate, yes[topic.logged], yes[topic.published])
        for topic in TOPICS.values()
    ]


def test_every_file_that_the_docs_name_exists() -> None:
    pages = [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]
    for page in pages:
        named = re.findall(r"\]\(([\w./-]+)\)", page.read_text())
        assert [name for name in named if not (page.parent / name).exists()] == [], page


def test_every_path_that_the_docs_name_exists() -> None:
    for page in [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]:
        named = re.findall(r"`((?:config|deploy|docs|script|tests)/[\w./-]+)`", page.read_text())
        assert [name for name in named if not (ROOT / name).exists()] == [], page


def test_every_package_that_the_docs_name_exists() -> None:
    for page in [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]:
        named = re.findall(r"`((?:gateway|devices|tests)(?:\.\w+)*)`", page.read_text())
        paths = [ROOT / name.replace(".", "/") for name in named]
        assert [str(path) for path in paths if not path.is_dir() and not path.with_suffix(".py").exists()] == [], page


def test_every_command_that_the_docs_show_is_understood() -> None:
    for page in [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]:
        text = re.sub(r"\s*\\\n\s*", " ", page.read_text())
        lines = re.findall(r"^ {4,}(?:sudo )?(?:\.venv/bin/)?(plumbline (?!COMMAND).*)$", text, re.MULTILINE)
        for line in lines:
            parser().parse_args(command_words(line)[1:])


def test_every_cited_source_is_in_the_references() -> None:
    listed = (DOCS / "reference" / "references.md").read_text().splitlines()
    code = [path for top in ("gateway", "devices") for path in (ROOT / top).rglob("*.py")]
    for path in [*code, *ROOT.glob("*.md"), *DOCS.rglob("*.md")]:
        cited = re.findall(r"\b([A-ZŁ]\w+)(?: et al\.| and others)?,? ((?:19|20)\d\d)\b(?!-)", path.read_text())
        missing = [(name, year) for name, year in cited if not any(name in row and year in row for row in listed)]
        assert missing == [], path


@pytest.mark.parametrize("name", PAGES)
def test_generated_page_is_up_to_date(name: str) -> None:
    assert (DOCS / name).read_text() == PAGES[name](), "run script/docs"
