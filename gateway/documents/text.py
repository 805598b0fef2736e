"""Names and sentences as a document prints them."""

from collections.abc import Sequence

ELLIPSIS = "…"
REPLACEMENT = "\ufffd"


def printable_text(text: str, limit: int) -> str:
    """Return text of unknown origin with at most `limit` characters; those that cannot be printed are replaced."""
    seen = "".join(character if character.isprintable() else REPLACEMENT for character in text[: limit + 1])
    return seen if len(seen) <= limit else f"{seen[: limit - 1]}{ELLIPSIS}"


def human_name(name: str) -> str:
    """Return an identifier such as `wind_gust` as words."""
    return name.replace("_", " ")


def join_names(names: Sequence[str], last: str = "and") -> str:
    """Return identifiers as words in a row: `a, b and c`."""
    words = [human_name(name) for name in names]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}" if words else "nothing"


def as_sentence(text: str) -> str:
    """Return text with a capital at the front and a full stop at the end."""
    text = text.strip()
    return text if not text else text[0].upper() + text[1:] + ("" if text[-1] in ".!?" else ".")
