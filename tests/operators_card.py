"""The operator's card as PDF, one page for each language, from docs/guides/operator/operators_card.md by Debian's chromium."""

import html
import re
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "docs" / "guides" / "operator" / "operators_card.md"
CHROMIUM = "/usr/bin/chromium"
ONLY_ONLINE = "For print:"
STYLE = """
@page { size: A4; margin: 14mm }
body { font: 11.5pt/1.27 sans-serif; margin: 0 }
section + section { break-before: page }
h1 { font-size: 24pt; margin: 0 0 2mm }
table { border-collapse: collapse; width: 100%; margin: 3mm 0 }
th, td { border: 0.4mm solid #444; padding: 1.6mm 2.2mm; text-align: left; vertical-align: top }
th { background: #ddd } td:first-child { font-size: 14pt; width: 25% }
ul { padding-left: 6mm } li { margin: 1.2mm 0 }
"""


def card_html(text: str) -> str:
    """Return the pages of the card: a section for each first-level heading."""
    parts = re.split(r"^# ", text, flags=re.MULTILINE)[1:]
    sections = "".join(f"<section>{_section('# ' + part)}</section>" for part in parts)
    return f"<!doctype html><meta charset=utf-8><style>{STYLE}</style>{sections}"


def _section(text: str) -> str:
    return "".join(_block(block) for block in text.strip().split("\n\n") if ONLY_ONLINE not in block)


def _block(block: str) -> str:
    """Return a paragraph, list, table or heading: the few forms of Markdown that the card uses."""
    lines = block.splitlines()
    if block.startswith("# "):
        return f"<h1>{_inline(block[2:])}</h1>"
    if block.startswith("- "):
        items = re.split(r"^- ", block, flags=re.MULTILINE)[1:]
        return "<ul>" + "".join(f"<li>{_inline(item)}</li>" for item in items) + "</ul>"
    if block.startswith("|"):
        head, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
        body = "".join("<tr>" + "".join(f"<td>{_inline(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        return "<table><tr>" + "".join(f"<th>{_inline(cell)}</th>" for cell in head) + f"</tr>{body}</table>"
    return f"<p>{_inline(block)}</p>"


def _inline(text: str) -> str:
    text = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", html.escape(text.replace("\n", " ")))
    return re.sub(r"\*(.+?)\*", r"<i>\1</i>", text)


def main(path: str) -> None:
    """Write the PDF."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM)
        page = browser.new_page()
        page.set_content(card_html(SOURCE.read_text()))
        page.pdf(path=path, prefer_css_page_size=True)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1])
