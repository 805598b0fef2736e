"""Everything that can happen on the wire of a sensor on a serial port, on real pseudo-terminals, for every kind of sensor."""

import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from devices.block import SampleBlock
from devices.errors import DeviceError, TransferError
from devices.host_clock import HostClock
from devices.serial_sensor import SerialSensor
from tests.devices.serial.serial_peer import Peer
from tests.devices.serial.serial_rigs import ODR_HZ, RIGS, SerialRig
from tests.waiting import PATIENCE_S

NOISE = np.random.default_rng(12).integers(0, 256, 1500, dtype=np.uint8).tobytes()

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("rig", RIGS, ids=str)]


class PacedPeer(Peer):
    """A peer that sends from a thread of its own."""

    def __init__(self, name: Path) -> None:
        super().__init__(name)
        self._threads: list[threading.Thread] = []
        self._stopping = threading.Event()

    def send_paced(self, pieces: list[bytes], pause_s: float) -> None:
        """Send pieces, with a pause after each, until the end of the test."""

        def run() -> None:
            for piece in pieces:
                if self._stopping.is_set():
                    return
                self.send(piece)
                time.sleep(pause_s)

        self._threads.append(threading.Thread(target=run, daemon=True))
        self._threads[-1].start()

    def wait(self) -> None:
        """Wait until all is sent."""
        for thread in self._threads:
            thread.join()

    def stop(self) -> None:
        self._stopping.set()
        self.wait()


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[PacedPeer]:
    peer = PacedPeer(tmp_path / "port")
    yield peer
    peer.stop()
    peer.close()


@pytest.fixture
def device(rig: SerialRig, peer: PacedPeer) -> Iterator[SerialSensor]:
    device = rig.open(str(peer.name), HostClock())
    device.open()
    yield device
    device.close()


def read_until(rig: SerialRig, device: SerialSensor, last: int) -> list[SampleBlock]:
    """Return the blocks up to the sample of a number."""
    blocks: list[SampleBlock] = []
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        block = device.read()
        blocks += [block] if block is not None else []
        if block is not None and rig.numbers(block)[-1] == last:
            check_times(blocks)
            return blocks
    raise AssertionError(f"sample {last} never came")


def numbers(rig: SerialRig, blocks: list[SampleBlock]) -> list[int]:
    return [number for block in blocks for number in rig.numbers(block)]


def check_times(blocks: list[SampleBlock]) -> None:
    assert (np.diff(np.concatenate([block.time_ns for block in blocks])) > 0).all()


def samples_of(rig: SerialRig, frames: range) -> list[int]:
    return list(range(frames.start * rig.samples, frames.stop * rig.samples))


def send_in_real_time(rig: SerialRig, peer: PacedPeer, frames: list[bytes]) -> None:
    peer.send_paced([*frames, rig.end], rig.samples / ODR_HZ)


def test_undisturbed_frames_have_no_faults(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    send_in_real_time(rig, peer, rig.frames(50))
    blocks = read_until(rig, device, 50 * rig.samples - 1)
    assert numbers(rig, blocks) == samples_of(rig, range(50))
    assert sum(block.lost + block.invalid for block in blocks) == 0
    assert not +Counter(device.faults)


def test_silence_is_no_block_and_no_fault(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    """A node counts on while its radio is silent; what has no numbers is counted by time."""
    frames = rig.frames(40)
    send_in_real_time(rig, peer, frames[:20])
    before = read_until(rig, device, 20 * rig.samples - 1)
    peer.wait()
    assert device.read() is None
    frames[20] = frames[20][len(rig.end) :]
    send_in_real_time(rig, peer, frames[20:])
    after = read_until(rig, device, 40 * rig.samples - 1)
    check_times(before + after)
    assert not +Counter(device.faults)
    assert (sum(block.lost for block in after) == 0) == rig.numbered


def test_noise_between_frames_loses_at_most_the_frames_beside_it(
    rig: SerialRig, device: SerialSensor, peer: PacedPeer
) -> None:
    frames = rig.frames(60)
    send_in_real_time(rig, peer, [*frames[:30], NOISE, *frames[30:]])
    found = numbers(rig, read_until(rig, device, 60 * rig.samples - 1))
    assert set(samples_of(rig, range(60))) - set(found) <= set(samples_of(rig, range(28, 32)))
    assert found == sorted(set(found))
    assert sum(device.faults.values()) > 0


def test_cut_frames_lose_only_themselves(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    """And the one before, where a frame is used only if another follows; the one after, where a frame ends with a zero."""
    frames = rig.frames(60)
    cut = range(10, 50, 10)
    sent = [frame[: len(frame) // 2] if number in cut else frame for number, frame in enumerate(frames)]
    send_in_real_time(rig, peer, sent)
    blocks = read_until(rig, device, 60 * rig.samples - 1)
    found = set(numbers(rig, blocks))
    cut_samples = {number for frame in cut for number in samples_of(rig, range(frame, frame + 1))}
    beside = {number + rig.samples * rig.also_lost for number in cut_samples}
    assert not found & cut_samples
    assert found | cut_samples | beside == set(samples_of(rig, range(60)))
    if rig.numbered:
        assert sum(block.lost for block in blocks) == len(cut_samples | beside)


def test_flipped_bits_lose_only_their_frames(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    """Frames without a checksum give samples with a wrong number in place of them."""
    frames = rig.frames(60)
    flipped = range(5, 50, 5)
    sent = [
        frame[:-6] + bytes([frame[-6] ^ 4]) + frame[-5:] if number in flipped else frame
        for number, frame in enumerate(frames)
    ]
    send_in_real_time(rig, peer, sent)
    blocks = read_until(rig, device, 60 * rig.samples - 1)
    gone = [] if not rig.checksum else flipped
    expected = [n for frame in range(60) if frame not in gone for n in samples_of(rig, range(frame, frame + 1))]
    assert numbers(rig, blocks) == expected
    assert sum(block.lost + block.invalid for block in blocks) == len(gone) * rig.samples
    assert sum(device.faults[name] for name in ("checksum", "stuffing", "length") if name in device.faults) == len(gone)


def test_bytes_at_a_tenth_of_the_speed_lose_nothing(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    data = b"".join(rig.frames(12)) + rig.end
    peer.send_paced([data[at : at + 1] for at in range(len(data))], 0.001)
    assert numbers(rig, read_until(rig, device, 12 * rig.samples - 1)) == samples_of(rig, range(12))
    assert not +Counter(device.faults)


def test_a_flood_loses_nothing(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    count = 1000
    data = b"".join(rig.frames(count)) + rig.end
    peer.send_paced([data[at : at + 1000] for at in range(0, len(data), 1000)], 0.0)
    assert numbers(rig, read_until(rig, device, count * rig.samples - 1)) == samples_of(rig, range(count))
    assert sum(device.faults.values()) == 0


def test_lost_alignment_is_found_again(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    frames = rig.frames(40)
    send_in_real_time(rig, peer, [frames[0][7:], *frames[1:20], frames[20][9:], *frames[21:]])
    found = numbers(rig, read_until(rig, device, 40 * rig.samples - 1))
    assert set(samples_of(rig, range(40))) - set(found) <= set(samples_of(rig, range(2))) | set(
        samples_of(rig, range(19, 21))
    )


def test_whole_lost_frames_are_counted(rig: SerialRig, device: SerialSensor, peer: PacedPeer) -> None:
    """What has no numbers counts them by time, see `test_witmotion_radio`, after a minute on the line."""
    if not rig.numbered:
        frames = rig.frames(40)
        send_in_real_time(rig, peer, [*frames[:20], *frames[23:]])
        assert len(numbers(rig, read_until(rig, device, 40 * rig.samples - 1))) == 37
        return
    frames = rig.frames(60)
    pieces = [b"" if number in (20, 21, 22, 40) else frame for number, frame in enumerate(frames)]
    send_in_real_time(rig, peer, pieces)
    blocks = read_until(rig, device, 60 * rig.samples - 1)
    assert [block.lost for block in blocks if block.lost] == [3 * rig.samples, rig.samples]
    assert len(numbers(rig, blocks)) == 56 * rig.samples


def test_frames_that_come_twice_are_dropped_where_they_have_numbers(
    rig: SerialRig, device: SerialSensor, peer: PacedPeer
) -> None:
    frames = rig.frames(30)
    send_in_real_time(rig, peer, [frame * (2 if number % 7 == 3 else 1) for number, frame in enumerate(frames)])
    found = numbers(rig, read_until(rig, device, 30 * rig.samples - 1))
    assert sorted(set(found)) == samples_of(rig, range(30))
    if rig.numbered:
        assert found == samples_of(rig, range(30))
        assert device.faults["repeated_frames"] == 4


def test_a_sensor_that_starts_again_is_followed_within_a_second(
    rig: SerialRig, device: SerialSensor, peer: PacedPeer
) -> None:
    send_in_real_time(rig, peer, rig.frames(150)[-50:])
    read_until(rig, device, 150 * rig.samples - 1)
    peer.wait()
    start_s = time.monotonic()
    frames = rig.frames(100)
    send_in_real_time(rig, peer, [frames[0][len(rig.end) :], *frames[1:]])
    blocks: list[SampleBlock] = []
    while not blocks or len(numbers(rig, blocks)) < 10:
        block = device.read()
        blocks += [block] if block is not None else []
        assert time.monotonic() - start_s < PATIENCE_S  # of samples of one second
    assert blocks[0].lost <= ODR_HZ


def test_an_unplugged_port_is_reported_and_followed_when_it_is_back(
    rig: SerialRig, device: SerialSensor, peer: PacedPeer
) -> None:
    frames = rig.frames(60)
    send_in_real_time(rig, peer, frames[:20])
    read_until(rig, device, 20 * rig.samples - 1)
    peer.wait()
    peer.unplug()
    with pytest.raises(TransferError, match=r"the port has gone|takes no bytes"):
        device.read()
    device.close()
    with pytest.raises(DeviceError, match="no such port"):
        device.open()
    peer.plug_in()
    device.open()
    start_s = time.monotonic()
    send_in_real_time(rig, peer, frames[30:])
    while device.read() is None:
        assert time.monotonic() - start_s < PATIENCE_S
    assert device.faults["disconnect"] == 1
