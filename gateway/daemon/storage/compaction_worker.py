"""The compaction thread: rewrites ended segments, repairs incomplete ones, and trims those that the quota would take."""

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from devices.errors import RecordingError
from gateway.daemon.runtime.worker import BoundedQueue, Worker
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.salvage import SalvageReport, describe_losses
from gateway.recording.segments.compaction import CompactionError
from gateway.recording.segments.events import uncompacted_marker

log = logging.getLogger("plumbline.recorder")
MAX_WAITING_SEGMENTS = 4096
"""Segments that may wait. Basis: a choice; more than a quota has, and a bound of the memory."""


@dataclass(frozen=True, slots=True)
class RewriteRequest:
    """A segment that shall be rewritten."""

    path: Path
    rewrite: Callable[[Path, SegmentChain], SalvageReport]
    """`compact` or `trim`; returns what an interruption had cost of it."""


class CompactionWorker(Worker[RewriteRequest]):
    """Rewrites one segment after the other, beside the recording."""

    def __init__(self, chain: SegmentChain) -> None:
        super().__init__("compaction", BoundedQueue(MAX_WAITING_SEGMENTS))
        self._chain = chain

    def handle(self, item: RewriteRequest) -> None:
        """Rewrite a segment; it stays as it is where that fails."""
        path = item.path
        try:
            losses = item.rewrite(path, self._chain)
        except FileNotFoundError:
            log.info("%s: was deleted before it was rewritten", path)
        except CompactionError as error:
            log.warning("%s", error)
            with suppress(OSError):
                uncompacted_marker(path).unlink(missing_ok=True)  # another try would end in the same way
        except RecordingError as error:
            log.warning("%s", error)
        except OSError as error:
            log.warning("%s: not rewritten (%s); it stays readable as it is", path, error.strerror or error)
        else:
            if not losses.closed:
                log.warning("%s: repaired after an interruption: %s", path, ", ".join(describe_losses(losses)))

    def close(self) -> None:
        """Nothing is open between two segments."""
