"""A report, or a part of it, as a reader sees it: its text by section."""

from html.parser import HTMLParser

from gateway.documents.environment import render
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.page import DATA_CONTENT, MODEL_SECTIONS
from gateway.twin.report.verdict import verdict_content
from tests.values import present

VOID = {"meta", "br"}


class Page(HTMLParser):
    """Elements must nest; text is collected by section."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.sections: dict[str, str] = {}
        self.tags: list[str] = []
        self.section = ""
        self.feed(text)
        self.close()
        assert not self.open
        self.sections = {name: " ".join(text.split()) for name, text in self.sections.items()}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        name = dict(attrs).get("id")
        if name is not None:
            self.ids.append(name)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "section":
            assert name is not None
            self.section = name
            self.sections[name] = ""

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.section and "style" not in self.open:
            self.sections[self.section] += data

    @property
    def text(self) -> str:
        return " ".join(self.sections.values())


class Pages(dict[str, Page]):
    """The parsed report of each verdict."""

    def __init__(self, reports: dict[str, str]) -> None:
        super().__init__()
        self._reports = reports

    def __missing__(self, verdict: str) -> Page:
        self[verdict] = Page(self._reports[verdict])
        return self[verdict]


CONTENTS = {name: content for name, _, content in MODEL_SECTIONS}


def html_of(name: str, result: Reconciliation) -> str:
    if name in CONTENTS:
        content = CONTENTS[name](result, present(result.comparison))
    else:
        content = verdict_content(result) if name == "verdict" else DATA_CONTENT
    return render(f"report/{name}.html.j2", result=result, content=content)


def text_of(name: str, result: Reconciliation) -> str:
    return plain_text(html_of(name, result))


def plain_text(html: str) -> str:
    return Page(f'<section id="part">{html}</section>').text
