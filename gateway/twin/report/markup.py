"""HTML by elements: whatever is not markup already is escaped, so no text can become markup by oversight."""

from collections.abc import Iterable, Sequence
from html import escape


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def escaped(text: str) -> Html:
    """Text as markup; what UTF-8 cannot say, such as half a file name, becomes a question mark."""
    if isinstance(text, Html):
        return text
    return Html(escape(text.encode("utf-8", "replace").decode("utf-8")))


def element(tag: str, *children: str, **attributes: str) -> Html:
    """An element; `class_` is the attribute class, `aria_label` is aria-label."""
    named = (f' {name.rstrip("_").replace("_", "-")}="{escaped(value)}"' for name, value in attributes.items())
    return Html(f"<{tag}{''.join(named)}>{''.join(escaped(child) for child in children)}</{tag}>")


def joined(parts: Iterable[str], between: str = "") -> Html:
    """Parts one after the other."""
    return Html(escaped(between).join(escaped(part) for part in parts))


def paragraph(*children: str) -> Html:
    """Running text."""
    return element("p", *children)


def missing(what: str) -> Html:
    """Says that something is not there, where a reader would look for it."""
    return element("p", what, class_="missing")


def items(parts: Iterable[str]) -> Html:
    """A list with points."""
    return element("ul", *(element("li", part) for part in parts))


def section(title: str, *children: str, name: str) -> Html:
    """A part of the report; `name` is its anchor."""
    return element("section", element("h2", title), *children, id=name)


def illustration(picture: Html, *caption: str) -> Html:
    """A picture with what it shows below it; narrow screens scroll it sideways."""
    return element("figure", element("div", picture, class_="wide"), element("figcaption", *caption))


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: Sequence[int] = ()) -> Html:
    """Rows under a head; columns in `numbers` are set flush right."""

    def cells(tag: str, row: Sequence[str]) -> Html:
        return joined(
            element(tag, cell, class_="number") if i in numbers else element(tag, cell) for i, cell in enumerate(row)
        )

    body = (element("tr", cells("td", row)) for row in rows)
    built = element("table", element("thead", element("tr", cells("th", head))), element("tbody", *body))
    return element("div", built, class_="wide")


def facts(pairs: Iterable[tuple[str, str]]) -> Html:
    """Names with their values."""
    return element("dl", *(element("div", element("dt", name), element("dd", value)) for name, value in pairs))


def bar(share: float, kind: str) -> Html:
    """A bar in a cell, `share` of its width."""
    width = f"width:{100 * min(max(share, 0.0), 1.0):.1f}%"
    return element("span", element("span", class_=kind, style=width), class_="bar")
