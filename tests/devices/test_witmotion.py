import os
import pty
import struct
import threading
import time
from collections.abc import Iterator
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.block import SampleBlock
from devices.clock import HostClock
from devices.errors import DeviceAccessError, DeviceError, DeviceNotFoundError, TransferError
from devices.witmotion import WitMotion
from devices.witmotion_frames import FRAME_BYTES, FrameDecoder, Readings

GOLDEN = bytes.fromhex("55 51 00 00 00 00 00 08 C4 09 7B")
NOISE = np.random.default_rng(7).integers(0, 256, 4096, dtype=np.uint8).tobytes()


def frame(id_: int, *words: int) -> bytes:
    head = struct.pack("<BB4h", 0x55, id_, *words)
    return head + bytes([sum(head) & 0xFF])


def sample(number: int) -> bytes:
    """An acceleration frame that carries its own number."""
    return frame(0x51, number, -number, 2048, 2500 + number % 100)


def stream(numbers: range) -> bytes:
    return b"".join(sample(number) for number in numbers)


def cycle(number: int) -> bytes:
    """What a sensor sends by default: acceleration, rate, angle, magnetic field."""
    return sample(number) + b"".join(frame(id_, number, 2, 3, 4) for id_ in (0x52, 0x53, 0x54))


def numbers_of(readings: Readings) -> list[int]:
    return readings.counts[:, 0].tolist()


# frames


def test_golden_vector():
    readings = FrameDecoder().feed(GOLDEN * 2)
    assert readings.counts.tolist() == [[0, 0, 2048]] * 2
    assert readings.counts.dtype == np.int32
    assert readings.temperature_c.tolist() == [25.0] * 2


def test_words_are_signed():
    decoder = FrameDecoder()
    readings = decoder.feed(frame(0x51, -32768, 32767, -1, -1050) * 2)
    assert readings.counts[0].tolist() == [-32768, 32767, -1]
    assert readings.temperature_c[0] == -10.5


def test_one_valid_frame_is_no_lock():
    decoder = FrameDecoder()
    assert len(decoder.feed(sample(1))) == 0
    assert len(decoder.feed(NOISE[:11].replace(b"\x55", b"\x54"))) == 0
    assert decoder.faults["false_start"] == 1


@pytest.mark.parametrize("size", [1, 2, 5, 7, 11, 13, 100])
def test_frames_in_any_pieces(size):
    decoder = FrameDecoder()
    data = stream(range(30))
    found = [number for at in range(0, len(data), size) for number in numbers_of(decoder.feed(data[at : at + size]))]
    assert found == list(range(30))
    assert set(decoder.faults.values()) == {0}


@pytest.mark.parametrize("cut", range(1, 11))
def test_stream_joined_in_the_middle_of_a_frame(cut):
    decoder = FrameDecoder()
    assert numbers_of(decoder.feed(stream(range(10))[cut:])) == list(range(1, 10))
    assert decoder.faults["discarded_bytes"] == FRAME_BYTES - cut


def test_other_frames_are_known_and_left_out():
    decoder = FrameDecoder()
    readings = decoder.feed(b"".join(cycle(number) for number in range(20)))
    assert numbers_of(readings) == list(range(20))
    assert set(decoder.faults.values()) == {0}
    assert not readings.missing_before.any()


def test_frames_of_no_standard_kind_are_none():
    decoder = FrameDecoder()
    assert len(decoder.feed(frame(0x61, 1, 2, 3, 4) * 5)) == 0
    assert decoder.faults["discarded_bytes"] >= 4 * FRAME_BYTES
    among = FrameDecoder()
    among.feed(stream(range(5)) + frame(0x61, 1, 2, 3, 4) + stream(range(5, 10)))
    assert among.faults["checksum"] == 1


def test_flipped_bit_costs_its_frame_alone():
    for bit in range(8 * FRAME_BYTES):
        decoder = FrameDecoder()
        data = bytearray(stream(range(10)))
        data[5 * FRAME_BYTES + bit // 8] ^= 1 << bit % 8
        readings = decoder.feed(bytes(data))
        assert numbers_of(readings) == [0, 1, 2, 3, 4, 6, 7, 8, 9]
        assert readings.invalid_before.tolist() == [0, 0, 0, 0, 0, 1, 0, 0, 0]
        assert readings.lost_before.sum() == 0
        assert decoder.faults == {"checksum": 1, "false_start": 0, "discarded_bytes": FRAME_BYTES}


@pytest.mark.parametrize("gone", range(1, 11))
def test_lost_bytes_cost_their_frame_alone(gone):
    decoder = FrameDecoder()
    readings = decoder.feed(stream(range(6)) + sample(6)[gone:] + stream(range(7, 12)))
    assert numbers_of(readings) == [0, 1, 2, 3, 4, 5, *range(7, 12)]
    assert decoder.faults["discarded_bytes"] == FRAME_BYTES - gone
    if gone <= 5:  # beyond it the hole is nearer to no frame than to one
        assert readings.missing_before[6] == 1


@pytest.mark.parametrize("count", [1, 5, 10, 12, 200])
def test_garbage_between_frames_costs_none(count):
    decoder = FrameDecoder()
    readings = decoder.feed(stream(range(6)) + NOISE[:count] + stream(range(6, 12)))
    assert numbers_of(readings) == list(range(12))
    assert decoder.faults["discarded_bytes"] == count


@pytest.mark.parametrize("count", range(1, 8))
def test_missing_samples_are_counted_by_the_hole_in_the_bytes(count):
    data = [cycle(number) for number in range(30)]
    data[10 : 10 + count] = [bytes(len(entry)) for entry in data[10 : 10 + count]]
    readings = FrameDecoder().feed(b"".join(data))
    assert numbers_of(readings) == [*range(10), *range(10 + count, 30)]
    assert readings.missing_before[10] == count
    assert readings.missing_before.sum() == count


def test_broken_frame_of_another_kind_costs_no_sample():
    data = [cycle(number) for number in range(20)]
    data[10] = data[10][:20] + b"\xff" + data[10][21:]
    decoder = FrameDecoder()
    readings = decoder.feed(b"".join(data))
    assert numbers_of(readings) == list(range(20))
    assert decoder.faults["checksum"] == 1
    assert not readings.missing_before.any()


def test_reply_among_the_frames_is_no_loss():
    decoder = FrameDecoder()
    readings = decoder.feed(stream(range(10)) + frame(0x5F, 1, 2, 3, 4) + stream(range(10, 20)))
    assert numbers_of(readings) == list(range(20))
    assert not readings.missing_before.any()


def test_after_a_reset_nothing_is_missing_and_counts_stay():
    decoder = FrameDecoder()
    decoder.feed(stream(range(10)) + NOISE[:50] + sample(10)[:5])
    decoder.reset()
    readings = decoder.feed(stream(range(100, 110)))
    assert numbers_of(readings) == list(range(100, 110))
    assert not readings.missing_before.any()
    assert decoder.faults["discarded_bytes"] == 50


PIECES = st.lists(
    st.one_of(
        st.binary(max_size=60),
        st.integers(0, 30000).map(sample),
        st.integers(0, 30000).map(cycle),
        st.just(GOLDEN * 3),
        st.just(b"\x55" * 40),
        st.integers(0, 30000).map(lambda number: sample(number)[: number % FRAME_BYTES]),
    ),
    max_size=40,
)


@settings(max_examples=300, deadline=None)
@given(PIECES)
def test_any_bytes_are_decoded_or_counted_and_none_are_kept(pieces):
    decoder, whole = FrameDecoder(), FrameDecoder()
    found = [decoder.feed(piece) for piece in pieces]
    everything = whole.feed(b"".join(pieces))
    assert list(chain.from_iterable(numbers_of(readings) for readings in found)) == numbers_of(everything)
    missing = list(chain.from_iterable(readings.missing_before.tolist() for readings in found))
    assert missing == everything.missing_before.tolist()
    assert decoder.faults == whole.faults
    sent = sum(len(piece) for piece in pieces)
    assert len(everything) * FRAME_BYTES + decoder.faults["discarded_bytes"] <= sent
    assert len(decoder._buffer) < 2 * FRAME_BYTES
    assert (everything.lost_before >= 0).all()


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 10), st.binary(max_size=30)), max_size=8))
def test_no_sample_is_made_up(disturbances):
    """Whatever stands between the frames, what comes out was sent, in its order, and a clean end is found again."""
    data, number = b"", 1
    for count, garbage in disturbances:
        data += stream(range(number, number + count)) + garbage.replace(b"\x55", b"")
        number += count
    data += stream(range(number, number + 5))
    found = numbers_of(FrameDecoder().feed(data))
    assert found[-5:] == list(range(number, number + 5))
    assert all(earlier < later for earlier, later in pairwise(found))
    assert set(found) <= set(range(1, number + 5))


# port


class SetClock:
    """Gateway time that the test sets."""

    def __init__(self) -> None:
        self.time_ns = 1_700_000_000_000_000_000

    def now_ns(self) -> int:
        return self.time_ns

    def sleep_s(self, seconds: float) -> None:
        self.time_ns += round(seconds * 1e9)


class Peer:
    """The sensor's side of a pseudo-terminal, and a name of the other side that outlives it."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self.master = -1
        self.plug_in()

    def plug_in(self) -> None:
        self.master, slave = pty.openpty()
        self.number = os.ttyname(slave)
        os.close(slave)
        self.name.symlink_to(self.number)

    def unplug(self) -> None:
        os.close(self.master)
        self.name.unlink()
        self.master = -1

    def send(self, data: bytes) -> None:
        os.write(self.master, data)


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    peer = Peer(tmp_path / "sensor")
    yield peer
    if peer.master >= 0:
        os.close(peer.master)


@pytest.fixture
def clock() -> SetClock:
    return SetClock()


@pytest.fixture
def device(peer: Peer, clock: SetClock, tmp_path: Path) -> Iterator[WitMotion]:
    device = WitMotion(str(peer.name), clock=clock, odr_hz=100, block_samples=5, by_id=tmp_path / "by-id")
    yield device
    device.close()


def exchange(device: WitMotion, peer: Peer, clock: SetClock, data: bytes, passed_s: float = 0.05) -> SampleBlock | None:
    """What comes of the data, sent in the time that has passed since the last."""
    clock.sleep_s(passed_s)
    peer.send(data)
    return device.read()


def numbers(blocks: list[SampleBlock]) -> list[int]:
    return [number for block in blocks for number in block.raw[:, 0].tolist()]


def read_until(device: WitMotion, last: int) -> list[SampleBlock]:
    """Blocks up to the sample of that number."""
    blocks: list[SampleBlock] = []
    for _ in range(1000):
        block = device.read()
        blocks += [block] if block is not None else []
        if blocks and blocks[-1].raw[-1, 0] == last:
            return blocks
    raise AssertionError(f"sample {last} never came")


def test_stream_over_a_port_at_its_own_pace(peer):
    device = WitMotion(str(peer.name), clock=HostClock(), odr_hz=500, block_samples=4)
    info = device.open()
    assert (info.kind, info.unit, info.units_per_g, info.full_scale_g, info.odr_hz) == (
        "witmotion",
        "counts",
        2048,
        16,
        500,
    )
    assert info.details["resolution"] == "0.488 mg"

    def send() -> None:
        data = stream(range(150)) + NOISE[:33] + stream(range(150, 203)) + sample(203)[4:] + stream(range(204, 300))
        for at in range(0, len(data), 30):
            peer.send(data[at : at + 30])
            time.sleep(0.005)

    thread = threading.Thread(target=send)
    thread.start()
    blocks = read_until(device, 299)
    thread.join()
    device.close()
    assert numbers(blocks) == [*range(203), *range(204, 300)]
    assert all(block.raw.dtype == np.int32 for block in blocks)
    assert (np.diff(np.concatenate([block.time_ns for block in blocks])) > 0).all()
    assert device.faults["discarded_bytes"] == 33 + 7


def test_sample_times_come_from_the_count(device, peer, clock):
    device.open()
    jitter_s = np.random.default_rng(3).uniform(0, 0.01, 400)
    blocks = []
    start_ns = clock.now_ns()
    for number in range(400):
        clock.time_ns = start_ns + round((0.0505 * (number + 1) + jitter_s[number]) * 1e9)  # the sensor is 1 % slow
        peer.send(stream(range(5 * number, 5 * number + 5)))
        blocks.append(device.read())
    assert [len(block) for block in blocks] == [5] * 400
    time_s = (np.concatenate([block.time_ns for block in blocks]) - start_ns) / 1e9
    true_s = 0.0101 * (1 + np.arange(2000))
    assert np.abs(time_s - true_s)[1000:].max() < 1e-3
    assert blocks[0].temperature_c == 25.02
    assert device.faults["clock_relearned"] == 0


@pytest.mark.parametrize("place", [0, 2])
def test_a_hole_stands_between_blocks_and_keeps_its_time(device, peer, clock, place):
    device.open()
    blocks = [exchange(device, peer, clock, stream(range(5)))]
    frames = [sample(number) for number in range(5, 10)]
    frames[place] = bytes(FRAME_BYTES)
    blocks.append(exchange(device, peer, clock, b"".join(frames)))
    if place:
        blocks.append(device.read())
    before, after = blocks[-2:]
    assert numbers([after]) == list(range(6 + place, 10))
    assert (after.lost, after.invalid) == (0, 1)
    assert after.time_ns[0] - before.time_ns[-1] == pytest.approx(20e6, rel=0.01)
    assert after.time_ns[-1] - blocks[0].time_ns[0] == pytest.approx(90e6, rel=0.01)


def test_nothing_of_before_is_left_after_opening_again(device, peer, clock):
    device.open()
    exchange(device, peer, clock, stream(range(5)) + sample(5)[:4])
    exchange(device, peer, clock, sample(5)[4:] + bytes(FRAME_BYTES) + stream(range(7, 10)) + sample(10)[:4])
    faults = dict(device.faults)
    device.close()
    device.open()
    assert numbers([exchange(device, peer, clock, stream(range(20, 25)))]) == list(range(20, 25))
    assert dict(device.faults) == faults


def test_silence_is_none_and_what_was_lost_in_it_is_told(device, peer, clock):
    device.open()
    assert device.read() is None
    before = exchange(device, peer, clock, stream(range(5)))
    assert before.lost == 0
    assert device.read() is None
    after = exchange(device, peer, clock, stream(range(5)), passed_s=3.05)
    assert after.lost == 300
    assert after.time_ns[-1] == clock.now_ns()


def test_port_that_goes_away_is_told_and_found_again_when_it_is_back(device, peer, clock):
    device.open()
    exchange(device, peer, clock, stream(range(5)))
    peer.unplug()
    with pytest.raises(TransferError, match=rf"{peer.name}: the port has gone .*; plug its adapter in again"):
        device.read()
    device.close()
    with pytest.raises(DeviceNotFoundError, match=f"{peer.name}: no such port"):
        device.open()
    peer.plug_in()
    device.open()
    after = exchange(device, peer, clock, stream(range(100, 105)), passed_s=1.05)
    assert numbers([after]) == list(range(100, 105))
    assert after.lost == 100
    assert device.faults["disconnect"] == 1


def test_port_without_a_name_any_more_has_gone(device, peer):
    """The name under by-id vanishes with the adapter, even where reading goes on giving nothing."""
    device.open()
    peer.name.unlink()
    with pytest.raises(TransferError, match="the port has gone"):
        device.read()


def test_port_is_found_under_another_number_by_its_lasting_name(peer, clock, tmp_path):
    by_id = tmp_path / "by-id"
    by_id.mkdir()
    peer.unplug()
    peer.name = by_id / "usb-1a86_USB_Serial_0042-if00-port0"
    peer.plug_in()
    device = WitMotion(peer.number, clock=clock, by_id=by_id)
    assert device.open().device_id == "witmotion-usb-1a86_USB_Serial_0042-if00-port0"
    peer.unplug()
    with pytest.raises(TransferError, match="0042"):
        device.read()
    hold, other = pty.openpty()  # takes the old number
    peer.plug_in()
    info = device.open()
    assert info.device_id == "witmotion-usb-1a86_USB_Serial_0042-if00-port0"
    assert numbers([exchange(device, peer, clock, stream(range(8)))]) == list(range(8))
    device.close()
    os.close(hold)
    os.close(other)


def test_noise_is_counted_and_then_refused(device, peer, clock):
    device.open()
    peer.send(NOISE[:2304])
    with pytest.raises(
        DeviceError, match=rf"{peer.name}: no acceleration frame in 2\d\d\d bytes at 115200 baud; check the baud"
    ):
        read_until(device, 0)
    assert device.faults["discarded_bytes"] >= 2048
    device.open()
    assert numbers([exchange(device, peer, clock, stream(range(5)))]) == list(range(5))


def test_sensor_that_sends_no_acceleration_is_told(device, peer):
    device.open()
    peer.send(frame(0x53, 1, 2, 3, 4) * 200)
    with pytest.raises(DeviceError, match="check the baud rate, and that the sensor sends acceleration"):
        read_until(device, 0)


@pytest.mark.parametrize(("rate_hz", "refused"), [(100, False), (105, False), (125, True), (50, True)])
def test_rate_other_than_the_configured_one_is_refused(device, peer, clock, rate_hz, refused):
    device.open()
    text = ""
    try:
        for number in range(12 * rate_hz // 5):
            exchange(device, peer, clock, stream(range(number, number + 5)), passed_s=5 / rate_hz)
    except DeviceError as error:
        text = str(error)
    assert (f"{rate_hz:.1f} samples/s come where odr_hz says 100; set odr_hz" in text) == refused
    assert bool(text) == refused


def test_missing_port_names_those_that_are_there(clock, tmp_path):
    (tmp_path / "usb-FTDI-if00").symlink_to("/dev/null")
    device = WitMotion(str(tmp_path / "gone"), clock=clock, by_id=tmp_path)
    with pytest.raises(DeviceNotFoundError, match=rf"{tmp_path}/gone: no such port; .*{tmp_path} offers usb-FTDI-if00"):
        device.open()
    device = WitMotion(str(tmp_path / "gone"), clock=clock, by_id=tmp_path / "nowhere")
    with pytest.raises(DeviceNotFoundError, match="nowhere offers nothing"):
        device.open()


@pytest.mark.parametrize("path", ["/dev/null", "/dev"])
def test_what_is_no_serial_port(clock, path):
    with pytest.raises(
        DeviceNotFoundError, match=f"{path}: is not a serial port; name one, best under /dev/serial/by-id"
    ):
        WitMotion(path, clock=clock).open()


def test_port_that_this_user_may_not_open(device, peer, monkeypatch):
    really_open = os.open

    def refuse(path: str, *rest: int) -> int:
        if path == str(peer.name):
            raise PermissionError(13, "Permission denied", path)
        return really_open(path, *rest)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(
        DeviceAccessError, match=f"{peer.name}: may not be opened by this user; add it to the group dialout"
    ):
        device.open()


def test_port_that_another_holds(device, peer, clock):
    device.open()
    with pytest.raises(DeviceAccessError, match="another program holds the port; stop it"):
        WitMotion(str(peer.name), clock=clock).open()


def test_baud_rate_that_no_port_has(peer, clock):
    with pytest.raises(DeviceError, match=f"{peer.name}: the port cannot do -1 baud"):
        WitMotion(str(peer.name), -1, clock=clock).open()


@pytest.mark.parametrize("wrong", [{"odr_hz": 0}, {"block_samples": 0}])
def test_impossible_settings_are_refused(clock, wrong):
    with pytest.raises(ValueError, match="give at least 1 and a rate above 0"):
        WitMotion("/dev/ttyUSB0", clock=clock, **wrong)


def test_closed_port_is_not_read(device):
    device.close()
    with pytest.raises(TransferError, match="the port is not open"):
        device.read()
    device.open()
    device.close()
    device.close()
    with pytest.raises(TransferError, match="the port is not open"):
        device.read()


def test_label_of_the_sensor_is_its_identity(peer, clock):
    device = WitMotion(str(peer.name), clock=clock, serial="WT-17")
    assert device.open().device_id == "witmotion-WT-17"
    device.close()
