"""Names and sentences as a document prints them."""

from gateway.documents.format import as_sentence, human_name, join_names, printable_text


def test_names_are_joined_as_words() -> None:
    assert human_name("wind_gust") == "wind gust"
    assert join_names([]) == "nothing"
    assert join_names(["wind_gust"]) == "wind gust"
    assert join_names(["wind_gust", "impact", "hoisting"], "or") == "wind gust, impact or hoisting"


def test_sentences_start_with_a_capital_and_end_with_a_stop() -> None:
    assert as_sentence("too short; record more") == "Too short; record more."
    assert as_sentence("  Really?") == "Really?"
    assert as_sentence("") == ""


def test_text_of_unknown_origin_is_printable_and_bounded() -> None:
    assert printable_text("a\x00b\u202ec", 10) == "a\ufffdb\ufffdc"
    assert printable_text("abcdef", 4) == "abc…"
    assert printable_text("abcd", 4) == "abcd"
