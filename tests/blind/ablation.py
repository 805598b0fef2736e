"""A part of `reconcile` that can be taken away from outside, so that the product has no switch for it."""

import importlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial, wraps
from typing import Any, Protocol
from unittest.mock import patch

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision import verdict
from gateway.twin.reconcile.decision.evidence import Evidence
from gateway.twin.reconcile.search.candidates import CandidateTable

RECONCILE = "gateway.twin.reconcile."
Note = Callable[[], None]
Instead = Callable[..., Any]
"""What is called instead of a function; takes the function and its arguments."""


class Place(Protocol):
    """Where a part is looked up."""

    def off(self) -> Any:
        """Return a context without the part."""

    def watched(self, note: Note) -> Any:
        """Return a context with the part, which calls `note` where it does something."""


@dataclass(frozen=True, slots=True)
class Call:
    """A function of a module below `gateway.twin.reconcile`, and what is called instead."""

    where: str
    """`module.function`, where it is looked up."""
    instead: Instead
    is_pure: bool = True
    """The other function costs little, so that both can be called. Else the part always counts as acting."""

    @contextmanager
    def _replaced(self, by: Callable[[Instead], Instead]) -> Iterator[None]:
        place, _, name = self.where.rpartition(".")
        module = importlib.import_module(RECONCILE + place)
        original = getattr(module, name)
        with patch.object(module, name, wraps(original)(by(original))):
            yield

    def off(self) -> Any:
        """Call the other function."""
        return self._replaced(lambda original: partial(self.instead, original))

    def watched(self, note: Note) -> Any:
        """Call the function, and `note` where the other one returns something else."""

        def both(original: Instead) -> Instead:
            def call(*arguments: Any, **named: Any) -> Any:
                found = original(*arguments, **named)
                if not self.is_pure or not _is_same(found, self.instead(original, *arguments, **named)):
                    note()
                return found

            return call

        return self._replaced(both)


@dataclass(frozen=True, slots=True)
class RuleOfVerdict:
    """A rule of the verdict's table: without it the next one that applies decides."""

    index: int

    def off(self) -> Any:
        """Leave the rule out."""
        left = tuple(rule for index, rule in enumerate(verdict.RULES) if index != self.index)
        return patch.object(verdict, "RULES", left)

    def watched(self, note: Note) -> Any:
        """Call `note` where the rule decides."""
        rules = list(verdict.RULES)
        rule = rules[self.index]

        def conclude(evidence: Evidence) -> verdict.Decision:
            note()
            return rule.conclude(evidence)

        rules[self.index] = verdict.Rule(rule.applies, conclude)
        return patch.object(verdict, "RULES", tuple(rules))


@dataclass(frozen=True, slots=True)
class Part:
    """A part of `reconcile` that can be taken away."""

    does: str
    places: tuple[Place, ...]

    @contextmanager
    def off(self) -> Iterator[None]:
        """Without the part."""
        with ExitStack() as stack:
            for place in self.places:
                stack.enter_context(place.off())
            yield

    @contextmanager
    def watched(self, note: Note) -> Iterator[None]:
        """With the part, and a note where it does something."""
        with ExitStack() as stack:
            for place in self.places:
                stack.enter_context(place.watched(note))
            yield


def _is_same(one: Any, other: Any) -> bool:
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        return len(one) == len(other) and all(_is_same(*pair) for pair in zip(one, other, strict=True))
    if isinstance(one, CandidateTable) and isinstance(other, CandidateTable):
        return one.fits.keys() == other.fits.keys() and all(one.fits[each] is other.fits[each] for each in one.fits)
    if isinstance(one, Observations) and isinstance(other, Observations):
        return bool((one.used == other.used).all())
    return one is other or (isinstance(one, bool | float | int | str | frozenset) and one == other)
