"""A gateway that is started again twice: for another limit, and after a kill in the middle of a block's results."""

import json
from pathlib import Path

from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.recording.segments.compaction import compact
from tests.clocks import START_NS
from tests.gateway.recorded_crane import LIMITS, HastyCrane
from tests.gateway.recording.recorded_crane import BOOT_ID, SECOND_NS

FORMER_TRIP_DEG = 6.0
CHANGED_S, SECOND_START_S, KILL_S, THIRD_START_S = 7.0, 10.0, 25.0, 31.0
"""The limit is changed, the second run begins, it is killed, the third one begins: seconds from the start of the first."""
SECOND_BOOT, THIRD_BOOT = "b002", "b003"
END_S = 46.0
CHANGE = {
    "time_utc": "2026-01-01T00:00:07+00:00",
    "event": "applied",
    "id": "cli-1",
    "by": "ann",
    "reason": "crane <b>7</b>",
    "changes": [f"alerts.trip_deg: {FORMER_TRIP_DEG} -> {LIMITS['trip_deg']}"],
    "proposed_by": "bob",
}


class KilledCrane(HastyCrane):
    """Killed when the last block is on the disk and nothing of what follows from it."""

    last_ns = 2**63
    is_killed = False
    is_closed = False
    """Ended properly in place of the kill."""

    def write(self, message: OutgoingMessage) -> None:
        if self.is_killed:
            return
        super().write(message)
        if message.topic == "samples" and message.log_time_ns >= self.last_ns:
            self.recorder.tick(message.log_time_ns + SECOND_NS)
            if self.is_closed:
                self.close()
            self.recorder.abandon("killed")
            self.is_killed = True


def record_restarts(folder: Path) -> None:
    """Record three runs; the file that the kill has cut off is repaired, as at the gateway's next start."""
    first = HastyCrane(folder, BOOT_ID, START_NS, {**LIMITS, "trip_deg": FORMER_TRIP_DEG, "warn_deg": 5.9})
    first.record(CHANGED_S)
    first.log(f"audit {json.dumps(CHANGE)}", first.newest_ns, "plumbline.configuration")
    first.state = "stopping"
    first.record(1.0)
    first.close()
    second = KilledCrane(folder, SECOND_BOOT, _after_s(SECOND_START_S))
    second.last_ns = _after_s(KILL_S)
    second.record(KILL_S - SECOND_START_S + 1.0)
    third = HastyCrane(folder, THIRD_BOOT, _after_s(THIRD_START_S))
    for path in second.recorder.take_uncompacted():
        compact(path, third.chain)
    third.record(5.0)
    third.close()


def _after_s(seconds: float) -> int:
    return START_NS + round(seconds * 1e9)
