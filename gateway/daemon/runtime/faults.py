"""What does not work at present: one line for each part, how often it has failed, and the pauses between attempts."""

import logging
import threading
from collections import Counter

log = logging.getLogger("plumbline.fault")
RETRYING = "retrying; other functions are not affected"
"""End of the text of a part that is started again until it works."""


class FaultRegister:
    """The faults of the parts around the monitoring. Used by any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._standing: dict[str, str] = {}
        self._counts: Counter[str] = Counter()

    def set(self, part: str, text: str) -> None:
        """Note that a part does not work; a text that is new is also logged."""
        with self._lock:
            before = self._standing.get(part)
            self._standing[part] = text
            if before is None:
                self._counts[part] += 1
        if text != before:
            log.error("%s", text)

    def clear(self, part: str) -> None:
        """Note that a part works."""
        with self._lock:
            was_standing = self._standing.pop(part, None) is not None
        if was_standing:
            log.warning("%s: works again", part)

    @property
    def standing(self) -> dict[str, str]:
        """The parts that do not work, with the reason."""
        with self._lock:
            return dict(self._standing)

    @property
    def counts(self) -> dict[str, int]:
        """How often each part has stopped working, as `<part>_failures`."""
        with self._lock:
            return {f"{part}_failures": count for part, count in self._counts.items()}


class Backoff:
    """The pause before the next attempt."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self.pause_s = first_s
        self._longest_s = longest_s

    def increase(self) -> None:
        """Double the pause, up to the limit."""
        self.pause_s = min(2 * self.pause_s, self._longest_s)
