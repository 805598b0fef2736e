"""The place of a receiver in the outbox: the last change that it has, and what follows it."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from gateway.outbox.change import StoredChange

MAX_PAGE_BYTES = 48_000
"""Size of a page. Basis: a message on the bus may have 64 KiB."""


@dataclass(frozen=True, slots=True)
class Position:
    """The last change that a receiver has."""

    number: int
    """0: it has none."""
    boot_id: str | None = None
    """None: the number alone counts."""


@dataclass(frozen=True, slots=True)
class ChangePage:
    """Changes behind a position, in order."""

    changes: list[StoredChange]
    more: bool
    """More of them did not fit."""
    complete: bool
    """The position was found; without it these are the oldest that are kept, and changes before them may be missing."""


FileSpan = dict[str, tuple[int, int]]
"""The first and the last number of each boot in a file."""


def span_of(changes: Iterable[StoredChange]) -> FileSpan:
    """Return the numbers of some changes."""
    span: FileSpan = {}
    for change in changes:
        first, last = span.get(change.boot_id, (change.number, change.number))
        span[change.boot_id] = min(first, change.number), max(last, change.number)
    return span


def find_span(spans: Sequence[FileSpan], position: Position) -> int | None:
    """Return the place of the first span from which on the changes behind a position are complete; None without one."""
    if position.boot_id is None:
        return _find_number(spans, position.number)
    for place in reversed(range(len(spans))):
        first, last = spans[place].get(position.boot_id, (1, 0))
        if first <= position.number <= last:
            return place
    return None


def _find_number(spans: Sequence[FileSpan], number: int) -> int | None:
    ranges = [(place, first, last) for place, span in enumerate(spans) for first, last in span.values()]
    if ranges and ranges[0][1] > number + 1:
        return None  # changes before the oldest were deleted
    return next((place for place, _, last in ranges if last > number), len(spans))


def make_page(kept: Iterable[StoredChange], position: Position, most_bytes: int, *, is_known: bool) -> ChangePage:
    """Return the first page of the changes behind a position, or of all where the position is not known."""
    chosen: list[StoredChange] = []
    size = 0
    for change in _changes_behind(kept, position) if is_known else kept:
        size += len(change.payload)
        if chosen and size > most_bytes:
            return ChangePage(chosen, more=True, complete=is_known)
        chosen.append(change)
    return ChangePage(chosen, more=False, complete=is_known)


def _changes_behind(changes: Iterable[StoredChange], position: Position) -> Iterator[StoredChange]:
    """Yield the changes that follow a position which is among them."""
    is_passed = is_reached = False
    for change in changes:
        if not is_passed:
            is_own = position.boot_id in (None, change.boot_id)
            if is_own and change.number <= position.number:
                is_reached = True
                continue
            is_passed = is_own or is_reached
        if is_passed:
            yield change
