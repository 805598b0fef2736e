"""The operator's card explains every word of the page, in its languages, and its PDF has one page for each."""

import re
from pathlib import Path

import pytest

from gateway.languages import LANGUAGES, read_texts
from gateway.page.verdict import STYLES
from tests.operators_card import SOURCE, card_html

ROOT = Path(__file__).parents[1]
CARDS = dict(zip(("en", "de"), SOURCE.read_text().split("\n# "), strict=True))


@pytest.mark.parametrize("language", CARDS)
def test_every_word_of_the_page_is_explained(language: str) -> None:
    words = [read_texts(language)[f"word_{word}"] for word in STYLES if word != "NOT AUTHENTICATED"]  # of a site
    section = CARDS[language]
    assert [word for word in words if f"**{word}**" not in section] == []


@pytest.mark.parametrize("language", CARDS)
def test_every_button_that_the_card_names_is_on_the_page(language: str) -> None:
    table, section = read_texts(language), CARDS[language]
    for key in ("silence", "mute", "deciding_angle", "not_recording", "alerts", "sign_out"):
        assert table[key].rstrip(".").lower() in section.replace("\n", " ").lower(), key


def test_both_halves_say_the_same_in_the_same_places() -> None:
    """Each row and each point of one language is in the other, with as many words set off."""
    english, german = ([_outline(block) for block in half.split("\n\n")[1:]] for half in CARDS.values())
    assert english == german


def _outline(block: str) -> list[int]:
    parts = block.splitlines() if block.startswith("|") else re.split(r"^- ", block, flags=re.MULTILINE)
    return [part.count("**") for part in parts]


def test_the_languages_of_the_card_are_those_of_the_page() -> None:
    assert set(CARDS) <= set(LANGUAGES)


def test_the_printed_card_has_a_page_for_each_language() -> None:
    pdf = (ROOT / "docs" / "guides" / "operator" / "operators_card.pdf").read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 2


def test_the_card_is_plain_html() -> None:
    text = card_html(SOURCE.read_text())
    assert text.count("<section>") == 2
    assert text.count("<tr>") == 16
    assert "**" not in text
