"""HTML and SVG as a tree: text is escaped where the tree is written, so that no field of a record can become markup."""

from xml.etree.ElementTree import Element, SubElement, tostring

Content = Element | str | None
ELLIPSIS = "…"
REPLACEMENT = "\ufffd"


def element(name: str, /, *content: Content, **attributes: str | float) -> Element:
    """An element with its content; `class_` is `class`, other underscores are hyphens, None is left out."""
    made = Element(name, {_attribute(key): _text(value) for key, value in attributes.items()})
    for part in content:
        if isinstance(part, str):
            _append_text(made, part)
        elif part is not None:
            made.append(part)
    return made


def table(head: list[str], rows: list[list[Content]], class_: str) -> Element:
    """A table with a head; the first cell of each row is a heading too."""
    made = element("table", class_=class_)
    titles = SubElement(SubElement(made, "thead"), "tr")
    titles.extend(element("th", title, scope="col") for title in head)
    body = SubElement(made, "tbody")
    for row in rows:
        cells = [element("th", row[0], scope="row"), *(element("td", cell) for cell in row[1:])]
        body.append(element("tr", *cells))
    return made


def short(text: str, most: int) -> str:
    """A field of unknown origin as printable text of bounded length; marks what cannot be printed or turns the writing."""
    seen = "".join(character if character.isprintable() else REPLACEMENT for character in text[: most + 1])
    return seen if len(seen) <= most else f"{seen[: most - 1]}{ELLIPSIS}"


def written(root: Element) -> str:
    """The document."""
    return f"<!DOCTYPE html>\n{tostring(root, encoding='unicode', method='html')}\n"


def _attribute(key: str) -> str:
    return key.rstrip("_").replace("_", "-")


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _append_text(made: Element, text: str) -> None:
    if len(made):
        made[-1].tail = (made[-1].tail or "") + text
    else:
        made.text = (made.text or "") + text
