"""The languages of the pages: a file for each, with every text and the decimal mark."""

import json
from importlib import resources

_FILES = {
    file.name.removesuffix(".json"): file for file in resources.files(__name__).iterdir() if file.name.endswith(".json")
}
LANGUAGES = tuple(sorted(_FILES, key=lambda code: (code != "en", code)))
"""Their codes, English first."""


def read_texts(language: str) -> dict[str, str]:
    """Return the texts of a language by key; `{name}` in a text is a place for a value."""
    texts: dict[str, str] = json.loads(_FILES[language].read_text(encoding="utf-8"))
    return texts


def missing_texts(language: str) -> list[str]:
    """Return the keys that a language's file lacks, in the order of the English one."""
    texts = read_texts(language)
    return [key for key in read_texts("en") if key not in texts]
