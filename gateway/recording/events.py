"""Events, such as alerts and marks, and the index of the segments around them, which the quota deletes last."""

from collections import deque
from pathlib import Path

from gateway.messages import Alert, Calibration, Health, Log, Mark, Message
from gateway.recording.markers import Stretch, append_stretch

MOST_REMEMBERED = 128


class EventDetector:
    """Tells which messages are events: alerts, changes of the calibration, new faults, marks."""

    def __init__(self) -> None:
        self._calibration: tuple[str | None, str] | None = None
        self._faults: int | None = None

    def is_event(self, message: Message | Log) -> bool:
        """Return whether a message is an event; to be called with every message, in their order."""
        match message:
            case Mark():
                return True
            case Alert():
                return message.event in ("raised", "changed")
            case Calibration():
                before, self._calibration = self._calibration, (message.calibration_id, message.session.phase)
                return before is not None and before != self._calibration
            case Health():
                faults, self._faults = self._faults, sum(message.faults.values()) + (message.state == "recovering")
                return faults is not None and self._faults > faults
            case _:
                return False


class EventIndex:
    """Notes the time around events in a small file next to each segment, its marker, which survives a restart."""

    def __init__(self, pre_event_s: float, post_event_s: float) -> None:
        self._pre_ns = round(pre_event_s * 1e9)
        self._post_ns = round(post_event_s * 1e9)
        self._newest: Stretch | None = None
        self._open: Path | None = None
        self._ended: deque[tuple[Path, int]] = deque(maxlen=MOST_REMEMBERED)

    def begin_segment(self, path: Path, now_ns: int) -> None:
        """Note that a segment begins, which ends the one before. Raises `OSError`."""
        if self._open is not None:
            self._ended.append((self._open, now_ns))
        self._open = path
        if self._newest is not None and now_ns < self._newest.to_ns:
            append_stretch(path, self._newest)

    def add_event(self, now_ns: int) -> None:
        """Note an event for the open segment, those that ended shortly before, and those that begin shortly after.

        Raises `OSError`.
        """
        stretch = self._newest = Stretch(now_ns - self._pre_ns, now_ns + self._post_ns)
        recent = [path for path, ended_ns in self._ended if ended_ns >= stretch.from_ns and path.exists()]
        for path in [*recent, *([self._open] if self._open is not None else [])]:
            append_stretch(path, stretch)
