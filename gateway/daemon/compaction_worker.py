"""The compaction thread: rewrites ended segments, and repairs those that a kill or a power failure has left incomplete."""

import logging
from contextlib import suppress
from pathlib import Path

from devices.errors import RecordingError
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.worker import Worker
from gateway.recording.chain import SegmentChain
from gateway.recording.compaction import CompactionError, compact
from gateway.recording.mcap_salvage import describe_losses
from gateway.recording.retention import uncompacted_marker

log = logging.getLogger("plumbline.recorder")
INBOX = 4096


class CompactionWorker(Worker[Path]):
    """Rewrites one segment after the other, beside the recording."""

    def __init__(self, chain: SegmentChain) -> None:
        super().__init__("compaction", BoundedQueue(INBOX))
        self._chain = chain

    def handle(self, item: Path) -> None:
        """Rewrite a segment; it stays as it is where that fails."""
        try:
            losses = compact(item, self._chain)
        except FileNotFoundError:
            log.info("%s: was deleted before its compaction", item)
        except CompactionError as error:
            log.warning("%s", error)
            with suppress(OSError):
                uncompacted_marker(item).unlink(missing_ok=True)  # another try would end in the same way
        except RecordingError as error:
            log.warning("%s", error)
        except OSError as error:
            log.warning("%s: not compacted (%s); it stays readable as it is", item, error.strerror or error)
        else:
            if not losses.closed:
                log.warning("%s: repaired after an interruption: %s", item, ", ".join(describe_losses(losses)))

    def close(self) -> None:
        """Nothing is open between two segments."""
