"""The sensor behind a port: pace, times, holes, and ports that go away."""

import os
import pty
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import SampleBlock
from devices.errors import DeviceAccessError, DeviceError, DeviceNotFoundError, TransferError
from devices.host_clock import HostClock
from devices.serial.witmotion import open_witmotion
from devices.serial.witmotion_frames import FRAME_BYTES
from devices.serial_port import PortFolders
from devices.serial_sensor import SerialSensor
from tests.devices.serial.serial_peer import Peer, SetClock
from tests.devices.serial.witmotion_wire import NOISE, frame, sample, stream
from tests.values import present


@pytest.fixture
def device(peer: Peer, clock: SetClock, tmp_path: Path) -> Iterator[SerialSensor]:
    folders = PortFolders(by_id=tmp_path / "by-id")
    device = open_witmotion(str(peer.name), clock=clock, odr_hz=100, block_samples=5, folders=folders)
    yield device
    device.close()


def send(device: SerialSensor, peer: Peer, clock: SetClock, data: bytes, passed_s: float = 0.05) -> SampleBlock | None:
    """What comes of the data, sent in the time that has passed since the last."""
    clock.sleep_s(passed_s)
    peer.send(data)
    return device.read()


def exchange(device: SerialSensor, peer: Peer, clock: SetClock, data: bytes, passed_s: float = 0.05) -> SampleBlock:
    """The block that comes of the data."""
    return present(send(device, peer, clock, data, passed_s))


def numbers(blocks: list[SampleBlock]) -> list[int]:
    return [number for block in blocks for number in block.raw[:, 0].tolist()]


def read_until(device: SerialSensor, last: int) -> list[SampleBlock]:
    """Blocks up to the sample of that number."""
    blocks: list[SampleBlock] = []
    for _ in range(1000):
        block = device.read()
        blocks += [block] if block is not None else []
        if blocks and blocks[-1].raw[-1, 0] == last:
            return blocks
    raise AssertionError(f"sample {last} never came")


@pytest.mark.slow
def test_blocks_are_read_from_a_port_in_real_time(peer: Peer) -> None:
    device = open_witmotion(str(peer.name), clock=HostClock(), odr_hz=500, block_samples=4)
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


@pytest.mark.slow
def test_sample_times_come_from_the_count(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    jitter_s = np.random.default_rng(3).uniform(0, 0.01, 400)
    blocks = []
    start_ns = clock.now_ns()
    for number in range(400):
        clock.time_ns = start_ns + round((0.0505 * (number + 1) + jitter_s[number]) * 1e9)  # the sensor is 1 % slow
        peer.send(stream(range(5 * number, 5 * number + 5)))
        blocks.append(present(device.read()))
    assert [len(block) for block in blocks] == [5] * 400
    time_s = (np.concatenate([block.time_ns for block in blocks]) - start_ns) / 1e9
    true_s = 0.0101 * (1 + np.arange(2000))
    assert np.abs(time_s - true_s)[1000:].max() < 1e-3
    assert blocks[0].temperature_c == 25.02
    assert device.faults["clock_relearned"] == 0


@pytest.mark.parametrize("place", [0, 2])
def test_a_gap_is_between_blocks_and_keeps_its_time(
    device: SerialSensor, peer: Peer, clock: SetClock, place: int
) -> None:
    device.open()
    blocks = [exchange(device, peer, clock, stream(range(5)))]
    frames = [sample(number) for number in range(5, 10)]
    frames[place] = bytes(FRAME_BYTES)
    blocks.append(exchange(device, peer, clock, b"".join(frames)))
    if place:
        blocks.append(present(device.read()))
    before, after = blocks[-2:]
    assert numbers([after]) == list(range(6 + place, 10))
    assert (after.lost, after.invalid) == (0, 1)
    assert after.time_ns[0] - before.time_ns[-1] == pytest.approx(20e6, rel=0.01)
    assert after.time_ns[-1] - blocks[0].time_ns[0] == pytest.approx(90e6, rel=0.01)


def test_a_reading_at_the_end_of_the_range_is_marked(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    frames = [frame(0x51, 0, 0, z, 2500) for z in (2048, 32767, 32766, -32768, 2048)]
    block = exchange(device, peer, clock, b"".join(frames))
    assert present(block.saturated).tolist() == [False, True, False, True, False]


def test_reopening_discards_earlier_bytes(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    send(device, peer, clock, stream(range(5)) + sample(5)[:4])
    send(device, peer, clock, sample(5)[4:] + bytes(FRAME_BYTES) + stream(range(7, 10)) + sample(10)[:4])
    faults = dict(device.faults)
    device.close()
    device.open()
    assert numbers([exchange(device, peer, clock, stream(range(20, 25)))]) == list(range(20, 25))
    assert dict(device.faults) == faults


@pytest.mark.slow
def test_samples_lost_in_a_silence_are_counted(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    assert device.read() is None
    before = exchange(device, peer, clock, stream(range(5)))
    assert before.lost == 0
    assert device.read() is None
    after = exchange(device, peer, clock, stream(range(5)), passed_s=3.05)
    assert after.lost == 300
    assert after.time_ns[-1] == clock.now_ns()


def test_a_disconnected_port_is_reported_and_found_again(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
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


@pytest.mark.slow
def test_a_port_without_a_name_is_disconnected(device: SerialSensor, peer: Peer) -> None:
    """The name under by-id vanishes with the adapter, even where reading goes on giving nothing."""
    device.open()
    peer.name.unlink()
    with pytest.raises(TransferError, match="the port has gone"):
        device.read()


def test_a_port_is_found_by_its_persistent_name(peer: Peer, clock: SetClock, tmp_path: Path) -> None:
    by_id = tmp_path / "by-id"
    by_id.mkdir()
    peer.unplug()
    peer.name = by_id / "usb-1a86_USB_Serial_0042-if00-port0"
    peer.plug_in()
    device = open_witmotion(peer.number, clock=clock, folders=PortFolders(by_id=by_id))
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


def test_noise_on_the_line_is_counted_and_then_reported(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    peer.send(NOISE[:2304])
    with pytest.raises(
        DeviceError, match=rf"{peer.name}: no acceleration frame in 2\d\d\d bytes at 115200 baud; check the baud"
    ):
        read_until(device, 0)
    assert device.faults["discarded_bytes"] >= 2048
    device.open()
    assert numbers([exchange(device, peer, clock, stream(range(5)))]) == list(range(5))


def test_a_sensor_without_acceleration_frames_is_reported(device: SerialSensor, peer: Peer) -> None:
    device.open()
    peer.send(frame(0x53, 1, 2, 3, 4) * 200)
    with pytest.raises(DeviceError, match="check the baud rate, and that the sensor sends acceleration"):
        read_until(device, 0)


@pytest.mark.slow
@pytest.mark.parametrize(("rate_hz", "refused"), [(100, False), (105, False), (125, True), (50, True)])
def test_rate_other_than_the_configured_one_is_refused(
    device: SerialSensor, peer: Peer, clock: SetClock, rate_hz: int, refused: bool
) -> None:
    device.open()
    text = ""
    try:
        for number in range(12 * rate_hz // 5):
            send(device, peer, clock, stream(range(number, number + 5)), passed_s=5 / rate_hz)
    except DeviceError as error:
        text = str(error)
    assert (f"{rate_hz:.1f} samples/s arrive, but odr_hz is 100; set odr_hz" in text) == refused
    assert bool(text) == refused


def test_a_missing_port_is_reported_with_the_present_ports(clock: SetClock, tmp_path: Path) -> None:
    (tmp_path / "usb-FTDI-if00").symlink_to("/dev/null")
    device = open_witmotion(str(tmp_path / "gone"), clock=clock, folders=PortFolders(by_id=tmp_path))
    with pytest.raises(DeviceNotFoundError, match=rf"{tmp_path}/gone: no such port; .*{tmp_path} offers usb-FTDI-if00"):
        device.open()
    device = open_witmotion(str(tmp_path / "gone"), clock=clock, folders=PortFolders(by_id=tmp_path / "nowhere"))
    with pytest.raises(DeviceNotFoundError, match="nowhere offers nothing"):
        device.open()


@pytest.mark.parametrize("path", ["/dev/null", "/dev"])
def test_a_file_that_is_not_a_serial_port_is_refused(clock: SetClock, path: str) -> None:
    with pytest.raises(
        DeviceNotFoundError, match=f"{path}: is not a serial port; give one, preferably under /dev/serial/by-id"
    ):
        open_witmotion(path, clock=clock).open()


def test_a_port_without_permission_is_reported(
    device: SerialSensor, peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_a_port_in_use_is_reported(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    with pytest.raises(DeviceAccessError, match="another program holds the port; stop it"):
        open_witmotion(str(peer.name), clock=clock).open()


def test_an_impossible_baud_rate_is_reported(peer: Peer, clock: SetClock) -> None:
    with pytest.raises(DeviceError, match=f"{peer.name}: the port cannot do -1 baud"):
        open_witmotion(str(peer.name), -1, clock=clock).open()


@pytest.mark.parametrize("wrong", [{"odr_hz": 0}, {"block_samples": 0}])
def test_impossible_settings_are_refused(clock: SetClock, wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="give at least 1 and a rate above 0"):
        open_witmotion("/dev/ttyUSB0", clock=clock, **wrong)


def test_a_closed_port_cannot_be_read(device: SerialSensor) -> None:
    device.close()
    with pytest.raises(TransferError, match="the port is not open"):
        device.read()
    device.open()
    device.close()
    device.close()
    with pytest.raises(TransferError, match="the port is not open"):
        device.read()


def test_label_of_the_sensor_is_its_identity(peer: Peer, clock: SetClock) -> None:
    device = open_witmotion(str(peer.name), clock=clock, serial="WT-17")
    assert device.open().device_id == "witmotion-WT-17"
    device.close()
