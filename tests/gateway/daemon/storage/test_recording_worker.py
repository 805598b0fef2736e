"""The queue before the recorder: a source that can wait loses nothing while the disk takes something, and losses are counted."""

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.storage.recording_worker import (
    MAX_WAITING_RECORDS,
    ROOM_S,
    STALLED_S,
    CompactionWorker,
    RecordingWorker,
    RewriteRequest,
)
from gateway.messages import Samples
from gateway.pipeline.outgoing_message import EncodedMessage, encode_message
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader
from gateway.recording.format.salvage import SalvageReport
from gateway.recording.segments.compaction import compact, trim
from gateway.recording.segments.recorder import Recorder
from tests.gateway.conftest import make_samples


@pytest.fixture
def message() -> EncodedMessage:
    return encode_message("samples", make_samples(), 1)


@pytest.fixture
def full(tmp_path: Path, message: EncodedMessage) -> RecordingWorker:
    """A worker whose queue is full, and whose thread does not run."""
    header = RecordingHeader(
        software="0.1.0", site="yard", crane="crane-2", sensor="hook", boot_id="b00t", configuration_toml=""
    )
    recorder = Recorder(tmp_path, header, segment_s=600.0, fsync_s=1.0, quota_mb=100.0)
    worker = RecordingWorker(
        recorder,
        now_ns=lambda: 0,
        rewrite=print,
        data_dir=tmp_path,
        claim_folder=lambda: None,
        faults=FaultRegister(),
    )
    for _ in range(MAX_WAITING_RECORDS):
        worker.submit(message, can_wait=False)
    assert worker.samples_lost == 0
    return worker


def n_samples(message: EncodedMessage) -> int:
    assert isinstance(message.message, Samples)
    return len(message.message.x)


def test_a_live_source_never_waits_and_its_losses_are_counted(full: RecordingWorker, message: EncodedMessage) -> None:
    begun_s = time.monotonic()
    full.submit(message, can_wait=False)
    full.submit(message, can_wait=False)
    assert time.monotonic() - begun_s < 2 * ROOM_S
    assert full.samples_lost == 2 * n_samples(message)


@pytest.mark.slow
def test_a_source_that_can_wait_waits_for_a_slow_disk(full: RecordingWorker, message: EncodedMessage) -> None:
    threading.Timer(1.2, lambda: full.inbox.get(0.0)).start()
    full.submit(message, can_wait=True)
    assert full.samples_lost == 0
    assert len(full.inbox) == MAX_WAITING_RECORDS


def test_a_disk_that_hangs_is_not_waited_for(full: RecordingWorker, message: EncodedMessage) -> None:
    full.progress_s -= STALLED_S
    begun_s = time.monotonic()
    for _ in range(10):
        full.submit(message, can_wait=True)
    assert time.monotonic() - begun_s < 10 * ROOM_S
    assert full.samples_lost == 10 * n_samples(message)


@pytest.mark.parametrize("rewrite", [compact, trim])
def test_a_segment_that_the_quota_has_deleted_meanwhile_is_no_warning(
    rewrite: Callable[[Path, SegmentChain], SalvageReport], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    chain = SegmentChain(tmp_path, "yard/crane-2/hook", None)
    with caplog.at_level(logging.INFO):
        CompactionWorker(chain).handle(RewriteRequest(tmp_path / "gone.mcap", rewrite))
    (line,) = caplog.records
    assert (line.levelname, line.getMessage()) == (
        "INFO",
        f"{tmp_path / 'gone.mcap'}: was deleted before it was rewritten",
    )
