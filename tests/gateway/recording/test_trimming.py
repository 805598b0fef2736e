"""Trimming: the time around an event stays to the sample, everything else goes, and the proof stays valid."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from devices.block import DeviceInfo
from devices.errors import RecordingError
from gateway import messages
from gateway.pipeline.outgoing_message import encode_message
from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.chain_verification import verify_chain
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader
from gateway.recording.reading.samples import read_samples
from gateway.recording.segments.compaction import compact, trim
from gateway.recording.segments.events import EventIndex, is_trimmed
from gateway.recording.segments.recorder import Recorder

SECOND_NS = 1_000_000_000
PRE_S, POST_S, EVENT_S = 10, 15, 45


@pytest.fixture
def recorded(
    make_samples: Callable[..., messages.Samples],
    make_alert: Callable[..., messages.Alert],
    make_calibration: Callable[..., messages.Calibration],
    device: DeviceInfo,
    header: RecordingHeader,
    start_ns: int,
    tmp_path: Path,
) -> tuple[list[Path], SegmentChain]:
    """Three segments of 40 s with a block of 32 samples a second, and an alert 5 s into the second one."""
    chain = SegmentChain(tmp_path, "yard/crane-2/hook", load_or_create_key(tmp_path / "signing-key.pem"))
    events = EventIndex(PRE_S, POST_S)
    recorder = Recorder(tmp_path, header, segment_s=40, fsync_s=1.0, quota_mb=100, events=events, chain=chain)
    recorder.set_device(device, start_ns)
    recorder.start(start_ns)
    recorder.write(encode_message("calibration", make_calibration("c-1"), start_ns))
    for second in range(120):
        now_ns = start_ns + second * SECOND_NS
        samples = make_samples(second, length=32, period_ns=31_250_000.0)
        recorder.write(encode_message("samples", samples, samples.time_ns))
        if second == EVENT_S:
            recorder.write(encode_message("alert", make_alert("raised"), now_ns))
        recorder.tick(now_ns)
    recorder.close()
    for path in recorder.take_uncompacted():
        compact(path, chain)
    return sorted(tmp_path.glob("*.mcap")), chain


@pytest.mark.slow
def test_the_time_around_an_event_is_kept_to_the_sample(
    recorded: tuple[list[Path], SegmentChain], start_ns: int
) -> None:
    (_, path, _), chain = recorded
    before = read_samples([path])
    trim(path, chain)
    after = read_samples([path])
    kept, before_ns = set(after.samples.time_ns.tolist()), before.samples.time_ns
    around = before_ns[before_ns <= start_ns + (EVENT_S + POST_S) * SECOND_NS]
    assert set(around.tolist()) <= kept < set(before_ns.tolist())
    assert np.array_equal(after.samples.raw, before.samples.raw[np.isin(before_ns, after.samples.time_ns)])
    assert [each.message.calibration_id for each in after.calibrations] == ["c-1"]
    assert is_trimmed(path)
    with path.open("rb") as file:
        assert list(make_reader(file, validate_crcs=True).iter_messages(["/alert"]))


@pytest.mark.slow
def test_the_chain_stays_valid_and_says_what_was_trimmed(recorded: tuple[list[Path], SegmentChain]) -> None:
    paths, chain = recorded
    trim(paths[1], chain)
    found = verify_chain([verify_file(path, None) for path in paths], [paths[0].parent])
    assert found.answer != "differs", (found.problems, [file.problems for file in found.files])
    assert "trimmed by the quota to the time around events" in found.files[1].remarks
    changed = bytearray(paths[1].read_bytes())
    changed[len(changed) // 2] ^= 1
    paths[1].write_bytes(changed)
    assert verify_chain([verify_file(path, None) for path in paths]).answer == "differs"


def test_a_trimmed_newest_segment_is_followed_by_the_next(recorded: tuple[list[Path], SegmentChain]) -> None:
    paths, chain = recorded
    paths[2].unlink()
    trim(paths[1], chain)
    found = verify_chain([verify_file(path, None) for path in paths[:2]])
    assert found.problems == ()


def test_a_segment_that_is_damaged_is_not_trimmed(recorded: tuple[list[Path], SegmentChain]) -> None:
    (_, path, _), chain = recorded
    torn = path.read_bytes()[:-200]
    path.write_bytes(torn)
    with pytest.raises(RecordingError, match="is not trimmed"):
        trim(path, chain)
    assert path.read_bytes() == torn
