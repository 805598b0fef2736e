"""Output that never waits for its reader."""

import os
import time

from gateway.daemon.runtime.logs import MAX_WAITING_LINES, LineWriter
from tests.waiting import PATIENCE_S, wait_until


def test_a_reader_that_stalls_costs_lines_that_are_counted_and_reported() -> None:
    reading, writing = os.pipe()
    writer = LineWriter(writing)
    writer.start()
    begun_s = time.monotonic()
    for number in range(5 * MAX_WAITING_LINES):
        writer.put(f"{number:06d}" + 94 * "-")
    assert time.monotonic() - begun_s < PATIENCE_S
    wait_until(lambda: writer.dropped > 0, "a full queue")
    with os.fdopen(reading, "rb") as reader:
        lines: list[bytes] = []
        while not lines or not lines[-1].startswith(b"WARNING"):
            lines.append(reader.readline())
        assert lines[0].startswith(b"000000")
        assert lines[-1] == (
            f"WARNING plumbline: {writer.dropped} lines are missing here; the reader was too slow\n".encode()
        )
        assert len(lines) - 1 + writer.dropped == 5 * MAX_WAITING_LINES
        writer.finish(PATIENCE_S)
        assert not writer.is_alive()
    os.close(writing)


def test_a_reader_that_has_ended_ends_the_output_alone() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    writer = LineWriter(writing)
    writer.start()
    writer.put("nobody reads this")
    writer.join(PATIENCE_S)
    assert not writer.is_alive()
    writer.put("nor this")
    writer.finish(1)
    os.close(writing)
