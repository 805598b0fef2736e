"""The index of the segments that contain an alert or the time around one, which the quota deletes last."""

from collections import deque
from pathlib import Path

from gateway.recording.retention import marker_path

MOST_REMEMBERED = 128


class AlertEventIndex:
    """Marks segments by an empty file next to them, which survives a restart."""

    def __init__(self, pre_event_s: float, post_event_s: float) -> None:
        self._pre_ns = round(pre_event_s * 1e9)
        self._post_ns = round(post_event_s * 1e9)
        self._until_ns = 0
        self._open: Path | None = None
        self._ended: deque[tuple[Path, int]] = deque(maxlen=MOST_REMEMBERED)

    def begin_segment(self, path: Path, now_ns: int) -> None:
        """Note that a segment begins, which ends the one before. Raises `OSError`."""
        if self._open is not None:
            self._ended.append((self._open, now_ns))
        self._open = path
        if now_ns < self._until_ns:
            marker_path(path).touch()

    def add_event(self, now_ns: int) -> None:
        """Note an alert: mark the open segment, those that ended shortly before, and those that begin shortly after.

        Raises `OSError`.
        """
        self._until_ns = now_ns + self._post_ns
        recent = [path for path, ended_ns in self._ended if ended_ns >= now_ns - self._pre_ns and path.exists()]
        for path in [*recent, *([self._open] if self._open is not None else [])]:
            marker_path(path).touch()
