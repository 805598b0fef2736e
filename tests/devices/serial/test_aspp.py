"""A node behind a base station: gaps and times by its numbers, several nodes, and settings that do not agree."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

from devices.block import RadioStatus
from devices.errors import DeviceError
from devices.serial.aspp import AsppPart, open_aspp
from devices.serial_sensor import SerialSensor
from tests.devices.serial import serial_peer
from tests.devices.serial.aspp_wire import AsppNode, diagnostic_payload, numbers_of, packet, sweep_payload
from tests.devices.serial.serial_peer import Peer, SetClock
from tests.values import present

PERIOD_S = 4 / 128
exchange = partial(serial_peer.exchange, passed_s=PERIOD_S)


@pytest.fixture
def device(peer: Peer, clock: SetClock) -> Iterator[SerialSensor]:
    device = open_aspp(str(peer.name), 115200, node=50_001, clock=clock, range_g=8.0)
    device.open()
    yield device
    device.close()


def test_a_packet_is_a_block_in_g(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    block = exchange(device, peer, clock, AsppNode().frame())
    assert numbers_of(np.asarray(block.raw)) == [0, 1, 2, 3]
    assert block.raw[0].tolist() == [0.0, 0.0, 1.0]
    assert (block.lost, block.temperature_c, block.time_ns[-1]) == (0, None, clock.now_ns())
    assert block.radio == RadioStatus(signal_dbm=-60.0)
    info = device.open()
    assert (info.kind, info.device_id, info.unit, info.full_scale_g) == ("aspp", "aspp-50001", "g", 8.0)


@pytest.mark.slow
def test_temperature_and_battery_come_at_their_own_rate(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    node = AsppNode()
    report = packet(2, 0x11, 50_001, diagnostic_payload(battery_low=True, temperature_c=31.25))
    block = exchange(device, peer, clock, report + node.frame())
    assert (block.temperature_c, present(block.radio).battery_low) == (31.25, True)
    assert exchange(device, peer, clock, node.frame()).temperature_c == 31.25
    clock.sleep_s(76)
    assert device.read() is None
    late = exchange(device, peer, clock, node.frame())
    assert (late.temperature_c, late.radio) == (None, RadioStatus(signal_dbm=-60.0))


def test_nodes_on_one_base_are_told_apart_by_address(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    mine, others = AsppNode(), [AsppNode(address=address, version=version) for address, version in ((4, 1), (5, 3))]
    for number in range(30):
        block = exchange(device, peer, clock, others[0].frame() + mine.frame() + others[1].frame())
        assert numbers_of(np.asarray(block.raw)) == list(range(4 * number, 4 * number + 4))
    assert set(device.faults.values()) == {0}


def test_a_gap_across_the_wrap_of_the_numbers_is_explicit(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    node = AsppNode(tick=65_500)
    before = exchange(device, peer, clock, node.frame())
    node.lose(15)
    after = exchange(device, peer, clock, node.frame(), passed_s=16 * PERIOD_S)
    assert after.lost == 60
    assert after.time_ns[0] - before.time_ns[-1] == pytest.approx(61 / 128 * 1e9, rel=0.01)


def test_a_node_that_starts_again_is_followed(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    node = AsppNode(tick=30_000)
    before = exchange(device, peer, clock, node.frame())
    after = exchange(device, peer, clock, AsppNode().frame(), passed_s=2.0)
    assert device.faults["node_restarted"] == 1
    assert after.lost == pytest.approx((after.time_ns[0] - before.time_ns[-1]) / 1e9 * 128 - 1, abs=1)


def test_a_reading_at_full_scale_is_marked_and_one_that_is_no_number_is_dropped(
    device: SerialSensor, peer: Peer, clock: SetClock
) -> None:
    rows = [[0.0, 0.0, 8.0], [0.0, 0.0, math.nan], [math.inf, 0.0, 1.0], [0.0, -8.1, 1.0], [0.0, 0.0, 7.9]]
    clock.sleep_s(1.0)
    peer.send(packet(2, 0x1A, 50_001, sweep_payload(2, 0x1A, 0, rows)))
    blocks = [present(exchange(device, peer, clock, b"", passed_s=0.0)), present(device.read())]
    assert [present(block.saturated).tolist() for block in blocks] == [[True], [True, False]]
    assert [(block.lost, block.invalid) for block in blocks] == [(0, 0), (0, 2)]
    assert blocks[1].time_ns[0] - blocks[0].time_ns[0] == pytest.approx(3 / 128 * 1e9, rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"data_type": 7}, "sends data type 7, which is not calibrated; set its data format to calibrated"),
        ({"mask": 0b011}, r"sends channels \[1, 2\], but device.channels is \[1, 2, 3\]; activate them"),
        ({"rate": 105}, "is set to 256 samples/s, but odr_hz is 128; set odr_hz to the node's rate"),
    ],
)
def test_settings_that_do_not_agree_are_reported(
    device: SerialSensor, peer: Peer, changes: dict[str, Any], message: str
) -> None:
    columns = 2 if "mask" in changes else 3
    peer.send(packet(2, 0x1A, 50_001, sweep_payload(2, 0x1A, 0, [[0.0] * columns], **changes)))

    def listen() -> None:
        for _ in range(5):
            device.read()

    with pytest.raises(DeviceError, match=message):
        listen()


@pytest.mark.slow
def test_ten_minutes_at_5_percent_with_lost_packets() -> None:
    """One packet in twenty is lost, and once ten seconds of them."""
    rate_error = -0.05
    random = np.random.default_rng(4)
    part, node = AsppPart(node=50_001, odr_hz=128.0, range_g=8.0), AsppNode(per_packet=8)
    period_ns = 1e9 / 128 / (1 + rate_error)
    start_ns, read_ns, lost = SetClock().now_ns(), 0, 0
    errors, counted = [], 0
    for number in range(600 * 16):
        frame = node.frame()
        if random.uniform() < 0.05 or 4000 <= number < 4160:
            lost += 8
            continue
        end_ns = start_ns + (node.number - 1) * period_ns
        read_ns = max(read_ns, round(end_ns + random.uniform(0, 0.02) * 1e9))
        for block in part.feed(frame, read_ns):
            counted += block.lost
            errors.append((block.time_ns - start_ns - (end_ns - start_ns - period_ns * np.arange(7, -1, -1))) / 1e6)
    error_ms = np.concatenate(errors)
    assert abs(counted - lost) <= 8  # the last one may have been lost
    assert np.sqrt(np.mean(error_ms[1280:] ** 2)) < 0.2  # its constant part included
    assert part.faults["clock_relearned"] == 0
