"""The library of terms, and their time in the registry of effects."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.force_terms import FORCE_TERMS, KINEMATIC_TERMS
from gateway.twin.effects.reading_terms import DEAD_ZONE_TERMS, READING_TERMS
from gateway.twin.effects.term import Term

TERMS: Mapping[str, Term] = {
    term.name: term for term in (*FORCE_TERMS, *KINEMATIC_TERMS, *READING_TERMS, *DEAD_ZONE_TERMS)
}
"""Every term by its name."""
OF_MODELS, OF_SEARCH = "the terms of a model", "the library of terms"
"""Sources in the registry of effects."""


def register_terms(names: Iterable[str]) -> None:
    """Add those terms that a model names to the registry, to stay; other names are left alone."""
    EFFECTS.register([TERMS[name] for name in names if name in TERMS and name not in EFFECTS], OF_MODELS)


@contextmanager
def registered_library() -> Iterator[None]:
    """Add all terms to the registry of effects for as long as a law is sought."""
    EFFECTS.register([term for name, term in TERMS.items() if name not in EFFECTS], OF_SEARCH)
    try:
        yield
    finally:
        EFFECTS.unregister(OF_SEARCH)
