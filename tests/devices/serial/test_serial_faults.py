"""Everything that can happen on the wire of a sensor on a serial port, on real pseudo-terminals, for every kind of sensor.

Time passes as the test sets it, and what has come is read before more is sent: how busy the computer is changes nothing.
"""

import fcntl
import os
import termios
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

from devices import serial_sensor
from devices.block import SampleBlock
from devices.device import MAX_READ_S
from devices.errors import DeviceError, TransferError
from devices.serial_sensor import SerialSensor
from tests.devices.serial.serial_peer import Peer, SetClock
from tests.devices.serial.serial_rigs import ODR_HZ, RIGS, SerialRig
from tests.waiting import wait_until

NOISE = np.random.default_rng(12).integers(0, 256, 1500, dtype=np.uint8).tobytes()

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("rig", RIGS, ids=str)]


@pytest.fixture
def device(rig: SerialRig, peer: Peer, clock: SetClock, monkeypatch: pytest.MonkeyPatch) -> Iterator[SerialSensor]:
    """The sensor on a port that does not wait for bytes: they are there, or they do not come."""
    monkeypatch.setattr(serial_sensor, "MAX_READ_S", 0.001)
    device = rig.open(str(peer.name), clock)
    device.open()
    yield device
    device.close()


@dataclass
class Line:
    """The wire between a sensor and the gateway, which reads all that has come before more comes."""

    rig: SerialRig
    device: SerialSensor
    peer: Peer
    clock: SetClock

    def transmit(self, pieces: list[bytes], passed_s: float | None = None) -> list[SampleBlock]:
        """Return the blocks of what the sensor sends; before each piece the time of a frame passes, or that which is given."""
        blocks = []
        for piece in [*pieces, self.rig.end]:
            self.clock.sleep_s(self.rig.samples / ODR_HZ if passed_s is None else passed_s)
            self.peer.send(piece)
            wait_until(partial(self.has_unread, len(piece)), "the bytes on the port", look_s=1e-4)
            while not self.has_unread(0):
                blocks.append(self.device.read())
        return [block for block in blocks if block is not None]

    def transmit_until(self, last: int, pieces: list[bytes], passed_s: float | None = None) -> list[SampleBlock]:
        """Return the blocks up to the sample of a number, which may wait in the device behind others."""
        blocks = self.transmit(pieces, passed_s)
        while self.rig.numbers(blocks[-1])[-1] != last:
            block = self.device.read()
            assert block is not None, f"sample {last} never came"
            blocks.append(block)
        check_times(blocks)
        return blocks

    def has_unread(self, count: int) -> bool:
        """Whether there are so many bytes that the gateway has not read yet."""
        port = os.open(self.peer.number, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            return int.from_bytes(fcntl.ioctl(port, termios.FIONREAD, bytes(4)), "little") == count
        finally:
            os.close(port)


@pytest.fixture
def line(rig: SerialRig, device: SerialSensor, peer: Peer, clock: SetClock) -> Line:
    return Line(rig, device, peer, clock)


def numbers(rig: SerialRig, blocks: list[SampleBlock]) -> list[int]:
    return [number for block in blocks for number in rig.numbers(block)]


def check_times(blocks: list[SampleBlock]) -> None:
    assert (np.diff(np.concatenate([block.time_ns for block in blocks])) > 0).all()


def samples_of(rig: SerialRig, frames: range) -> list[int]:
    return list(range(frames.start * rig.samples, frames.stop * rig.samples))


def test_undisturbed_frames_have_no_faults(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    blocks = line.transmit_until(50 * rig.samples - 1, rig.frames(50))
    assert numbers(rig, blocks) == samples_of(rig, range(50))
    assert sum(block.lost + block.invalid for block in blocks) == 0
    assert not +Counter(device.faults)


def test_silence_is_no_block_and_no_fault(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    """A node counts on while its radio is silent; what has no numbers is counted by time."""
    frames = rig.frames(40)
    before = line.transmit_until(20 * rig.samples - 1, frames[:20])
    line.clock.sleep_s(MAX_READ_S)
    assert device.read() is None
    frames[20] = frames[20][len(rig.end) :]
    after = line.transmit_until(40 * rig.samples - 1, frames[20:])
    check_times(before + after)
    assert not +Counter(device.faults)
    assert (sum(block.lost for block in after) == 0) == rig.numbered


def test_noise_between_frames_loses_at_most_the_frames_beside_it(
    rig: SerialRig, device: SerialSensor, line: Line
) -> None:
    frames = rig.frames(60)
    found = numbers(rig, line.transmit_until(60 * rig.samples - 1, [*frames[:30], NOISE, *frames[30:]]))
    assert set(samples_of(rig, range(60))) - set(found) <= set(samples_of(rig, range(28, 32)))
    assert found == sorted(set(found))
    assert sum(device.faults.values()) > 0


def test_cut_frames_lose_only_themselves(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    """And the one before, where a frame is used only if another follows; the one after, where a frame ends with a zero."""
    frames = rig.frames(60)
    cut = range(10, 50, 10)
    sent = [frame[: len(frame) // 2] if number in cut else frame for number, frame in enumerate(frames)]
    blocks = line.transmit_until(60 * rig.samples - 1, sent)
    found = set(numbers(rig, blocks))
    cut_samples = {number for frame in cut for number in samples_of(rig, range(frame, frame + 1))}
    beside = {number + rig.samples * rig.also_lost for number in cut_samples}
    assert not found & cut_samples
    assert found | cut_samples | beside == set(samples_of(rig, range(60)))
    if rig.numbered:
        assert sum(block.lost for block in blocks) == len(cut_samples | beside)


def test_flipped_bits_lose_only_their_frames(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    """Frames without a checksum give samples with a wrong number in place of them."""
    frames = rig.frames(60)
    flipped = range(5, 50, 5)
    sent = [
        frame[:-6] + bytes([frame[-6] ^ 4]) + frame[-5:] if number in flipped else frame
        for number, frame in enumerate(frames)
    ]
    blocks = line.transmit_until(60 * rig.samples - 1, sent)
    gone = [] if not rig.checksum else flipped
    expected = [n for frame in range(60) if frame not in gone for n in samples_of(rig, range(frame, frame + 1))]
    assert numbers(rig, blocks) == expected
    assert sum(block.lost + block.invalid for block in blocks) == len(gone) * rig.samples
    assert sum(device.faults[name] for name in ("checksum", "stuffing", "length") if name in device.faults) == len(gone)


def test_bytes_at_a_tenth_of_the_speed_lose_nothing(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    data = b"".join(rig.frames(12)) + rig.end
    found = line.transmit_until(12 * rig.samples - 1, [data[at : at + 1] for at in range(len(data))], 0.001)
    assert numbers(rig, found) == samples_of(rig, range(12))
    assert not +Counter(device.faults)


def test_a_flood_loses_nothing(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    count = 1000
    data = b"".join(rig.frames(count))
    found = line.transmit_until(
        count * rig.samples - 1, [data[at : at + 1000] for at in range(0, len(data), 1000)], 0.0
    )
    assert numbers(rig, found) == samples_of(rig, range(count))
    assert sum(device.faults.values()) == 0


def test_lost_alignment_is_found_again(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    frames = rig.frames(40)
    sent = [frames[0][7:], *frames[1:20], frames[20][9:], *frames[21:]]
    found = numbers(rig, line.transmit_until(40 * rig.samples - 1, sent))
    assert set(samples_of(rig, range(40))) - set(found) <= set(samples_of(rig, range(2))) | set(
        samples_of(rig, range(19, 21))
    )


def test_whole_lost_frames_are_counted(rig: SerialRig, device: SerialSensor, line: Line) -> None:
    """What has no numbers counts them by time, see `test_witmotion_radio`, after a minute on the line."""
    if not rig.numbered:
        frames = rig.frames(40)
        blocks = line.transmit_until(40 * rig.samples - 1, [*frames[:20], *frames[23:]])
        assert len(numbers(rig, blocks)) == 37
        return
    frames = rig.frames(60)
    pieces = [b"" if number in (20, 21, 22, 40) else frame for number, frame in enumerate(frames)]
    blocks = line.transmit_until(60 * rig.samples - 1, pieces)
    assert [block.lost for block in blocks if block.lost] == [3 * rig.samples, rig.samples]
    assert len(numbers(rig, blocks)) == 56 * rig.samples


def test_frames_that_come_twice_are_dropped_where_they_have_numbers(
    rig: SerialRig, device: SerialSensor, line: Line
) -> None:
    frames = rig.frames(30)
    sent = [frame * (2 if number % 7 == 3 else 1) for number, frame in enumerate(frames)]
    found = numbers(rig, line.transmit_until(30 * rig.samples - 1, sent))
    assert sorted(set(found)) == samples_of(rig, range(30))
    if rig.numbered:
        assert found == samples_of(rig, range(30))
        assert device.faults["repeated_frames"] == 4


def test_a_sensor_that_starts_again_is_followed_within_a_second(
    rig: SerialRig, device: SerialSensor, line: Line
) -> None:
    line.transmit_until(150 * rig.samples - 1, rig.frames(150)[-50:])
    frames = rig.frames(100)
    blocks = line.transmit_until(100 * rig.samples - 1, [frames[0][len(rig.end) :], *frames[1:]])
    assert blocks[0].lost <= ODR_HZ
    assert numbers(rig, blocks)[0] <= ODR_HZ


def test_an_unplugged_port_is_reported_and_followed_when_it_is_back(
    rig: SerialRig, device: SerialSensor, line: Line
) -> None:
    frames = rig.frames(60)
    line.transmit_until(20 * rig.samples - 1, frames[:20])
    line.peer.unplug()
    with pytest.raises(TransferError, match=r"the port has gone|takes no bytes"):
        device.read()
    device.close()
    with pytest.raises(DeviceError, match="no such port"):
        device.open()
    line.peer.plug_in()
    device.open()
    assert line.transmit(frames[30:])
    assert device.faults["disconnect"] == 1
