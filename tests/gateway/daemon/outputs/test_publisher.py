"""Alerts on their way to the bus: stored first, never held up by a disk, in order, with a latency that is measured."""

import errno
import threading
import time
from pathlib import Path

import msgspec
import pytest

from gateway.authorization.message_signature import MessageSigner
from gateway.daemon.outputs import publisher
from gateway.daemon.outputs.publisher import MAX_KEPT_LATENCIES, AlertLatency, AlertSender
from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.storage import outbox_writer
from gateway.daemon.storage.outbox_writer import OutboxWriter
from gateway.messages import Alert
from gateway.outbox import AlertOutbox, Position, StoredChange
from tests.waiting import PATIENCE_S


def alert(number: int, rule: str | None = "swing") -> Alert:
    return Alert(
        time_ns=0,
        clock="synchronised",
        sequence=number,
        level="trip",
        event="raised" if rule else "standing",
        boot_id="b00t",
        alert_number=number,
        rule=rule,
        active=[],
        text="",
    )


class Site:
    """Writer and sender with their threads, and what was sent."""

    def __init__(self, folder: Path) -> None:
        self.sent: list[tuple[int, bool]] = []
        self.arrived = threading.Condition()
        self.faults = FaultRegister()
        self.writer = OutboxWriter(folder, self.faults)
        self.sender = AlertSender(
            "key", self.writer, lambda: 0, self.note, MessageSigner(lambda: None, "0" * 12, lambda: 0)
        )
        self.writer.start()
        self.sender.start()

    def note(self, topic: str, payload: bytes) -> None:
        content = msgspec.json.decode(payload)
        with self.arrived:
            self.sent.append((content["alert_number"], content["stored"]))
            self.arrived.notify()

    def wait(self, count: int) -> list[tuple[int, bool]]:
        with self.arrived:
            assert self.arrived.wait_for(lambda: len(self.sent) >= count, PATIENCE_S)
        return self.sent

    def stop(self) -> None:
        for thread in (self.sender, self.writer):
            thread.finish()
            thread.join(PATIENCE_S)


@pytest.mark.slow
def test_every_change_is_on_the_disk_before_it_is_sent_and_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publisher, "STORE_PATIENCE_S", PATIENCE_S)
    site = Site(tmp_path)
    for number in range(1, 30):
        site.sender.submit(alert(number), 0)
    site.sender.submit(alert(29, rule=None), 0)
    assert site.wait(30) == [(number, True) for number in [*range(1, 30), 29]]
    page = site.writer.page_after(Position(27, "b00t"))
    assert [change.number for change in page.changes] == [28, 29]
    site.stop()
    assert AlertOutbox(tmp_path).open() == 29


@pytest.mark.slow
def test_a_disk_that_hangs_delays_an_alert_by_the_stated_bound_at_most(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    released = threading.Event()
    monkeypatch.setattr(AlertOutbox, "append", lambda *_: released.wait(PATIENCE_S))
    monkeypatch.setattr(publisher, "STORE_PATIENCE_S", 2.0)
    site = Site(tmp_path)
    for number in (1, 2, 3):
        site.sender.submit(alert(number), 0)
    site.sender.submit(alert(3, rule=None), 0)
    begun_s = time.monotonic()
    assert site.wait(4) == [(1, False), (2, False), (3, False), (3, False)]
    assert time.monotonic() - begun_s < 3 * 2.0  # together, not one bound after the other
    assert [change.number for change in site.writer.page_after(Position(0, "b00t")).changes] == [1, 2, 3]
    assert site.sender.sent_unstored == 3
    released.set()
    site.stop()


def test_what_a_broken_disk_did_not_take_is_stored_in_order_when_it_works_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    works = AlertOutbox.append

    def broken(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(outbox_writer, "DISK_RETRY_S", 0.05)
    monkeypatch.setattr(publisher, "STORE_PATIENCE_S", PATIENCE_S)
    monkeypatch.setattr(AlertOutbox, "append", broken)
    site = Site(tmp_path)
    site.sender.submit(alert(1), 0)
    site.sender.submit(alert(2), 0)
    assert site.wait(2) == [(1, False), (2, False)]
    assert site.faults.counts
    monkeypatch.setattr(AlertOutbox, "append", works)
    site.sender.submit(alert(3), 0)
    assert site.wait(3)[2] == (3, True)
    site.stop()
    stored = AlertOutbox(tmp_path).page_after(Position(0)).changes
    assert [change.number for change in stored] == [1, 2, 3]


@pytest.mark.slow
def test_without_a_folder_alerts_are_numbered_from_one_and_sent(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    site = Site(tmp_path / "file" / "alerts")
    assert site.writer.await_last_number(PATIENCE_S) == 0
    site.sender.submit(alert(1), 0)
    assert site.wait(1) == [(1, False)]
    site.stop()


def test_numbers_continue_from_the_largest_that_is_stored(tmp_path: Path) -> None:
    outbox = AlertOutbox(tmp_path)
    outbox.append([StoredChange("a", number, b"{}") for number in (41, 42)])
    outbox.close()
    site = Site(tmp_path)
    assert site.writer.await_last_number(PATIENCE_S) == 42
    site.stop()


def test_the_latency_states_median_99th_percentile_and_maximum_of_the_last_hour() -> None:
    latency = AlertLatency()
    assert latency.summary_ms(0) is None
    for number in range(1, 101):
        latency.add(sample_ns=0, sent_ns=number * 1_000_000)
    assert latency.summary_ms(10**9) == {"count": 100, "p50": 50.0, "p99": 99.0, "max": 100.0}
    assert latency.summary_ms(2 * 3600 * 10**9) is None
    for _ in range(2 * MAX_KEPT_LATENCIES):
        latency.add(sample_ns=0, sent_ns=10**9)
    summary = latency.summary_ms(10**9)
    assert summary is not None
    assert summary["count"] == MAX_KEPT_LATENCIES
