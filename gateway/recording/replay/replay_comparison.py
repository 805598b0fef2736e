"""The comparison of recorded messages with those that were computed again: every byte, or every number within a tolerance."""

import json
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isclose
from typing import Any, TypeVar

from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.recording.format.content import decimals_of, encode_recorded
from gateway.recording.reading.recording_file import RecordedMessage
from gateway.topics import TOPICS

MAX_COUNTERPART_DELAY_NS = 5_000_000_000
"""A message whose counterpart has not come this much later has none. Basis: a choice; longer than the longest interval of any
topic but the calibration, and a bound of the memory."""
LATEST_NS = 2**63
"""Definition: later than any time of a recording."""
PROSE = frozenset({"text", "reasons", "reason_codes", "change"})
"""Fields with numbers in words, which are not compared within a tolerance."""
RELATIVE_TOLERANCE = 1e-6
"""Relative difference of numbers that count as equal. Basis: a choice; above the rounding of a sum, below any recorded digit."""
MISSING = "(none)"
Waiting = TypeVar("Waiting", RecordedMessage, OutgoingMessage)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far numbers may differ, and which are compared."""

    description: str
    steps: float = 0.0
    """In units of the last recorded digit; 0: not at all, to the byte."""
    ignored: frozenset[str] = PROSE
    fields: Mapping[str, frozenset[str]] | None = None
    """The fields that are compared, by topic; None: all."""

    def selects(self, topic: str) -> bool:
        """Return whether messages of a topic are compared."""
        return self.fields is None or topic in self.fields

    def selected(self, topic: str, content: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of a message that are compared."""
        wanted = None if self.fields is None else self.fields[topic]
        return {
            name: value
            for name, value in content.items()
            if name not in self.ignored and (wanted is None or name in wanted)
        }

    def allows(self, name: str, recorded: float, recomputed: float) -> bool:
        """Return whether two values of a field may differ so."""
        decimals = decimals_of(name)
        absolute = (
            self.steps * 10.0**-decimals if decimals >= 0 else 0.5 * abs(recorded)
        )  # two digits of an uncertainty
        return isclose(recorded, recomputed, rel_tol=RELATIVE_TOLERANCE, abs_tol=absolute)


EXACT = Tolerance("byte for byte", ignored=frozenset())
OTHER_PLATFORM = Tolerance("within two units of the last recorded digit, without texts", steps=2.0)
"""Another machine or NumPy rounds differently. Basis: a last bit of a value may cross the middle between two digits, and a sum
carries it to the next."""
AFTER_START = Tolerance(
    "acceleration within 0.00005 g and tilt within 0.005 deg; motion, swing, conditions and alerts, which depend on the "
    "whole run, only in the table",
    steps=5.0,
    fields={
        "/acceleration": frozenset({"x_g", "y_g", "z_g"}),
        "/tilt": frozenset({"pitch_deg", "roll_deg", "axial_deg"}),
    },
)
"""The start of the run is missing, and with it what the motion filter had learnt. Basis: half a digit of the fourth and of the
second decimal."""


@dataclass(frozen=True, slots=True)
class ReplayDifference:
    """One difference."""

    topic: str
    log_time_ns: int
    utc_ns: int
    field: str
    recorded: Any
    recomputed: Any


@dataclass(slots=True)
class ReplayComparison:
    """Pairs the messages of one topic and time, and counts those that are equal."""

    tolerance: Tolerance
    compared: Counter[str] = field(default_factory=Counter)
    differing: Counter[str] = field(default_factory=Counter)
    compared_within: Counter[str] = field(default_factory=Counter)
    """The same by the description of the tolerance."""
    cut_off: Counter[str] = field(default_factory=Counter)
    """Messages without a counterpart at the end of the last file, or of one that was cut off: no difference."""
    not_compared: Counter[str] = field(default_factory=Counter)
    """Recorded messages beside and behind missing samples that depend on them, and what has no counterpart beside them: no
    difference."""
    first: ReplayDifference | None = None
    _recorded: dict[tuple[str, int], deque[RecordedMessage]] = field(default_factory=dict)
    """Those that wait for their counterpart, by topic and time."""
    _recomputed: dict[tuple[str, int], deque[OutgoingMessage]] = field(default_factory=dict)

    def add_recorded(self, message: RecordedMessage) -> None:
        """Take a recorded message."""
        key = message.topic, message.log_time_ns
        if (counterpart := _take_first(self._recomputed, key)) is None:
            self._recorded.setdefault(key, deque()).append(message)
        else:
            self._compare(message, counterpart)

    def add_recomputed(self, message: OutgoingMessage) -> None:
        """Take a message that was computed again."""
        key = TOPICS[message.topic].path, message.log_time_ns
        if (counterpart := _take_first(self._recorded, key)) is None:
            self._recomputed.setdefault(key, deque()).append(message)
        else:
            self._compare(counterpart, message)

    def leave_out(self, message: RecordedMessage) -> None:
        """Count a recorded message that cannot be computed again."""
        self.not_compared[message.topic] += 1

    def end_waiting(self, until_ns: int, torn_from_ns: int = LATEST_NS, *, is_gap: bool = False) -> None:
        """Count what waits from before a time: it has no counterpart. From `torn_from_ns` on it was cut off, or is at a gap."""
        torn = self.not_compared if is_gap else self.cut_off
        for key in [key for key in self._recorded if key[1] < until_ns]:
            for recorded in self._recorded.pop(key):
                self._compare(recorded, None, torn if key[1] >= torn_from_ns else None)
        for key in [key for key in self._recomputed if key[1] < until_ns]:
            for recomputed in self._recomputed.pop(key):
                self._compare(None, recomputed, torn if key[1] >= torn_from_ns else None)

    def _compare(
        self,
        recorded: RecordedMessage | None,
        recomputed: OutgoingMessage | None,
        torn: Counter[str] | None = None,
    ) -> None:
        """Compare two messages; `torn` takes one without a counterpart that is no difference."""
        topic = recorded.topic if recorded is not None else TOPICS[recomputed.topic].path if recomputed else ""
        difference = None
        if not self.tolerance.selects(topic):
            self.not_compared[topic] += recorded is not None
            return
        if recorded is None and recomputed is not None and self._is_thinned_out(recomputed):
            return
        if torn is not None:
            torn[topic] += 1
            return
        if recorded is None or recomputed is None:
            difference = _one_is_missing(recorded, recomputed)
        else:
            content = encode_recorded(recomputed.message)
            if content != recorded.data:
                difference = self._first_difference(recorded, content)
        self.compared[topic] += 1
        self.compared_within[self.tolerance.description] += 1
        if difference is not None:
            self.differing[topic] += 1
            if self.first is None or difference.log_time_ns < self.first.log_time_ns:
                self.first = difference

    def _is_thinned_out(self, recomputed: OutgoingMessage) -> bool:
        """Return whether the recorder leaves a message out; without the start of the run its number is not known."""
        every = TOPICS[recomputed.topic].recorded_every
        number = getattr(recomputed.message, "sequence", 0)
        return every > 1 and (self.tolerance is AFTER_START or number % every != 0)

    def _first_difference(self, recorded: RecordedMessage, recomputed: bytes) -> ReplayDifference | None:
        contents = [json.loads(recorded.data), json.loads(recomputed)]
        before, after = (self.tolerance.selected(recorded.topic, content) for content in contents)
        for path, one, other in self._differences(before, after):
            return _difference(recorded, path, one, other)
        return None if self.tolerance.steps else _difference(recorded, "", recorded.data, recomputed)

    def _differences(self, before: Any, after: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
        """Yield the place and the values of each difference between two parsed messages."""
        if isinstance(before, dict) and isinstance(after, dict):
            for name in [*before, *(name for name in after if name not in before)]:
                if name not in self.tolerance.ignored:
                    place = f"{path}.{name}" if path else name
                    yield from self._differences(before.get(name), after.get(name), place)
        elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
            for number, (one, other) in enumerate(zip(before, after, strict=True)):
                yield from self._differences(one, other, f"{path}[{number}]")
        elif isinstance(before, float) and isinstance(after, int | float) and self.tolerance.steps:
            if not self.tolerance.allows(path.rsplit(".", 1)[-1].split("[", maxsplit=1)[0], before, after):
                yield path, before, after
        elif before != after:
            yield path, before, after


def _take_first(waiting: dict[tuple[str, int], deque[Waiting]], key: tuple[str, int]) -> Waiting | None:
    """Remove and return the first of the messages that wait under a key; None where none does."""
    messages = waiting.get(key)
    if messages is None:
        return None
    first = messages.popleft()
    if not messages:
        del waiting[key]
    return first


def _difference(recorded: RecordedMessage, path: str, before: Any, after: Any) -> ReplayDifference:
    return ReplayDifference(recorded.topic, recorded.log_time_ns, recorded.publish_time_ns, path, before, after)


def _one_is_missing(recorded: RecordedMessage | None, recomputed: OutgoingMessage | None) -> ReplayDifference:
    if recorded is not None:
        return _difference(recorded, "message", "recorded", MISSING)
    assert recomputed is not None
    utc_ns = getattr(recomputed.message, "time_ns", recomputed.log_time_ns)
    path = TOPICS[recomputed.topic].path
    return ReplayDifference(path, recomputed.log_time_ns, utc_ns, "message", MISSING, "recomputed")
