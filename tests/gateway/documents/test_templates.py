"""Templates escape every value, refuse missing ones, and are part of the package."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from jinja2 import UndefinedError

from gateway.documents.environment import TEMPLATES, environment, render

ROOT = Path(__file__).parents[3]
SOURCES = sorted(TEMPLATES.rglob("*.j2"))
HOSTILE = "</style><script>alert(1)</script>\"'&amp;\u202e\x00\ud800"
OWN_SVG = "{{ figure.svg | safe }}"
"""The only markup that is inserted as it is: figures drawn by the program itself."""


def rendered(source: str, **view: object) -> str:
    return environment().from_string(source).render(view)


def test_every_value_is_escaped_in_text_and_attributes() -> None:
    text = rendered('<p title="{{ value }}">{{ value }}</p>', value=HOSTILE)
    assert "<script>" not in text
    assert text.count("&lt;/style&gt;&lt;script&gt;alert(1)&lt;/script&gt;&#34;&#39;&amp;amp;") == 2


def test_unprintable_characters_are_replaced() -> None:
    text = rendered("{{ value }}", value=HOSTILE)
    assert not set(text) & {"\u202e", "\x00", "\ud800"}
    text.encode()
    assert rendered("{{ value }}", value="° − “é” \N{NO-BREAK SPACE}\n") == "° − “é” \N{NO-BREAK SPACE}\n"


def test_escaping_does_not_depend_on_the_name_of_a_template() -> None:
    assert environment().autoescape is True


def test_missing_value_is_an_error() -> None:
    with pytest.raises(UndefinedError):
        rendered("{{ absent }}")
    with pytest.raises(UndefinedError):
        rendered("{{ view.absent }}", view=object())
    with pytest.raises(TypeError, match="None"):
        rendered("{{ value }}", value=None)


def test_coordinates_are_printed_with_six_digits() -> None:
    assert rendered("{{ value }}", value=1 / 3) == "0.333333"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(TEMPLATES)))
def test_no_template_switches_escaping_off(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"\bsafe\b", text.replace(OWN_SVG, ""))
    assert "autoescape" not in text
    assert "Markup" not in text


def test_no_module_makes_markup_of_text() -> None:
    modules = [
        path
        for room in ("documents", "certificate", "incident", "twin/report")
        for path in (ROOT / "gateway" / room).rglob("*.py")
    ]
    assert modules
    for path in modules:
        assert not re.search(r"\b(markupsafe|Markup|__html__\s*=|def __html__)\b", path.read_text(encoding="utf-8")), (
            path
        )


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(TEMPLATES)))
def test_no_template_refers_to_another_host(path: Path) -> None:
    assert not re.search(r"\b(src|href)=|https?:|url\(|@import", path.read_text(encoding="utf-8"))


def test_templates_are_part_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"]["gateway"]
    packaged = {path for pattern in patterns for path in (ROOT / "gateway").glob(pattern)}
    assert set(SOURCES) <= packaged


@pytest.mark.slow
def test_jinja_is_not_imported_before_the_first_document() -> None:
    code = "import sys, gateway.recording.segments.segment; sys.exit('jinja2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_document_declares_its_encoding_and_forbids_scripts_and_requests() -> None:
    text = render("base.html.j2", title="<b>")
    assert '<meta charset="utf-8">' in text
    assert "default-src 'none'; style-src 'unsafe-inline'" in text
    assert "<title>&lt;b&gt;</title>" in text
