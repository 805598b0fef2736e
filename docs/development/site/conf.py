"""Sphinx's settings for `script/site`: the pages of docs as they stand, with a list of them beside each and a search."""

import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[2]
GROUPS = {
    "Operator": "guides/operator",
    "Service": "guides/service",
    "Investigator": "guides/investigator",
    "Integrator": "guides/integrator",
    "Reference": "reference",
    "Evidence": "evidence",
    "Development": "development",
}

LINK = re.compile(r"\[([^\]]+)\]\(([^)#\s:]+\.md)(?:#[^)]*)?\)")

project = "Plumbline"
extensions = ["myst_parser"]
root_doc = "README"
source_suffix = {".md": "markdown"}
myst_heading_anchors = 4
html_theme = "furo"
html_title = "Plumbline"
html_show_sphinx = False
html_show_copyright = False
suppress_warnings = [
    "misc.highlighting_failure",  # languages of controllers and diagrams that Pygments does not know
    "myst.header",  # the operator's card has one title for each language
]


def _contents() -> str:
    """Return the list of all pages, each group with its first page first."""
    lists = []
    for caption, folder in GROUPS.items():
        pages = sorted((DOCS / folder).rglob("*.md"), key=lambda page: (page.name != "README.md", page))
        names = "\n".join(page.relative_to(DOCS).with_suffix("").as_posix() for page in pages)
        lists.append(f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{names}\n```\n")
    return "".join(lists)


def _prepare(app: Any, name: str, source: list[str]) -> None:
    folder = Path(app.env.doc2path(name)).parent

    def only_words(link: re.Match[str]) -> str:
        inside = (folder / link[2]).resolve().is_relative_to(DOCS)
        return link[0] if inside else link[1]

    source[0] = LINK.sub(only_words, source[0])
    if name == root_doc:
        source[0] += _contents()
    source[0] = re.sub(r"^```mermaid$", "```text", source[0], flags=re.MULTILINE)


def setup(app: Any) -> None:
    """While pages are read, give the first one the list of all, and make words of links to pages that the site does not have."""
    app.connect("source-read", _prepare)
