"""A node behind its receiver: times by its clock, gaps by its numbers, and everything that can happen to it."""

from collections.abc import Iterator

import numpy as np
import pytest

from devices.block import RadioStatus, SampleBlock
from devices.errors import DeviceError
from devices.serial.node import NodePart, open_node
from devices.serial_sensor import SerialSensor
from tests.devices.serial.node_wire import Node, numbers_of
from tests.devices.serial.serial_peer import Peer, SetClock, exchange
from tests.values import present


@pytest.fixture
def device(peer: Peer, clock: SetClock) -> Iterator[SerialSensor]:
    device = open_node(str(peer.name), node=7, clock=clock, odr_hz=100, block_samples=5)
    yield device
    device.close()


def test_a_block_is_a_frame_in_g_with_what_the_node_reports(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    info = device.open()
    assert (info.kind, info.device_id, info.unit, info.units_per_g, info.odr_hz) == ("node", "node-7", "g", 1.0, 100)
    block = exchange(device, peer, clock, Node().frame())
    assert block.raw.dtype == np.float64
    assert block.raw[0].tolist() == pytest.approx([0, 0, 1.0], abs=1e-4)
    assert (block.temperature_c, block.lost, block.invalid) == (21.5, 0, 0)
    assert block.radio == RadioStatus(battery_v=3.7, battery_low=False, signal_dbm=-67.0)
    assert np.diff(block.time_ns).tolist() == [10_000_000] * 4
    assert block.time_ns[-1] == clock.now_ns()
    assert not present(block.saturated).any()


def test_a_reading_at_full_scale_is_marked(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    counts = np.array([[0, 0, 1000], [0, 0, 2047], [-2047, 0, 0], [0, 2046, 0], [0, 0, -2048]], np.int16)
    block = exchange(device, peer, clock, Node().frame(counts=counts, full_scale=2047))
    assert present(block.saturated).tolist() == [False, True, True, False, True]


def test_label_of_the_node_is_its_identity(peer: Peer, clock: SetClock) -> None:
    device = open_node(str(peer.name), node=7, clock=clock, serial="H-12")
    assert device.open().device_id == "node-H-12"
    device.close()


@pytest.mark.slow
def test_other_nodes_on_the_receiver_are_ignored(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    mine, other = Node(), Node(node=8)
    block = exchange(device, peer, clock, other.frame() + mine.frame() + other.frame())
    assert numbers_of(block.raw) == list(range(5))
    assert device.read() is None
    assert set(device.faults.values()) == {0}


def test_a_node_that_is_not_heard_is_reported_with_those_that_are(
    device: SerialSensor, peer: Peer, clock: SetClock
) -> None:
    device.open()
    others = Node(node=8), Node(node=9)

    def listen() -> None:
        for _ in range(300):
            clock.sleep_s(0.05)
            peer.send(others[0].frame() + others[1].frame())
            assert device.read() is None

    with pytest.raises(DeviceError, match=r"node 7 is not heard; heard are 8 \(\d+ frames\), 9 \(\d+ frames\); set"):
        listen()
    assert clock.now_ns() - SetClock().now_ns() == pytest.approx(2.5e9, abs=0.3e9)
    device.open()
    exchange(device, peer, clock, Node().frame())
    heard_ns = clock.now_ns()
    with pytest.raises(DeviceError, match="node 7 is not heard"):
        listen()
    assert clock.now_ns() - heard_ns == pytest.approx(10e9, abs=0.3e9)


def test_a_newer_version_is_counted(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    from tests.devices.serial.test_node_frames import repacked  # noqa: PLC0415

    device.open()
    node = Node()
    block = exchange(device, peer, clock, b"\0" + repacked(0, "<B", 2) + b"\0" + node.frame())
    assert len(block) == 5
    assert device.faults["version"] == 1


@pytest.mark.parametrize("boot", [None, 1])
def test_a_node_that_starts_again_is_followed_within_a_second(
    device: SerialSensor, peer: Peer, clock: SetClock, boot: int | None
) -> None:
    """Also one that cannot tell its starts apart."""
    device.open()
    node = Node()
    blocks = [exchange(device, peer, clock, node.frame()) for _ in range(20)]
    node.restart(boot)
    back_from_ns = clock.now_ns() + 2_950_000_000
    clock.sleep_s(2.95)
    for _ in range(20):
        clock.sleep_s(0.05)
        peer.send(node.frame())
        block = device.read()
        if block is not None:
            blocks.append(block)
    first = blocks[20]
    assert first.time_ns[0] - back_from_ns < 1_000_000_000
    assert first.lost == pytest.approx((first.time_ns[0] - blocks[19].time_ns[-1]) / 10_000_000 - 1, abs=1)
    assert device.faults["node_restarted"] == 1
    assert np.all(np.diff(np.concatenate([block.time_ns for block in blocks])) > 0)
    assert sum(block.lost for block in blocks[21:]) == 0


def test_frames_that_come_twice_or_late_are_dropped(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    device.open()
    node = Node()
    frames = [node.frame() for _ in range(6)]
    for frame in (frames[0], frames[1]):
        exchange(device, peer, clock, frame)
    block = exchange(device, peer, clock, frames[1] + frames[0] + frames[2])
    assert numbers_of(block.raw) == list(range(10, 15))
    assert (block.lost, device.faults["repeated_frames"]) == (0, 2)
    later = exchange(device, peer, clock, frames[4] + frames[3] + frames[5], passed_s=0.15)
    assert (numbers_of(later.raw), later.lost) == (list(range(20, 25)), 5)
    assert numbers_of(present(device.read()).raw) == list(range(25, 30))


def test_a_pause_that_the_numbers_do_not_show_is_found_by_the_clock(
    device: SerialSensor, peer: Peer, clock: SetClock
) -> None:
    device.open()
    node = Node()
    for _ in range(40):
        before = exchange(device, peer, clock, node.frame())
    node.t_us += 400_000
    after = exchange(device, peer, clock, node.frame(), passed_s=0.45)
    assert after.lost == 40
    assert np.diff(after.time_ns).tolist() == pytest.approx([1e7] * 4, rel=0.001)
    assert after.time_ns[0] - before.time_ns[-1] == pytest.approx(410e6, rel=0.01)


class Air:
    """Frames of a node with its own rate, which are read late, or not at all."""

    def __init__(
        self,
        rate_error: float,
        *,
        jitter_s: float = 0.02,
        retry_s: float = 0.0,
        per_frame: int = 8,
        odr_hz: float = 100.0,
    ) -> None:
        self.part = NodePart(node=7, odr_hz=odr_hz)
        self.node = Node(rate_hz=odr_hz, per_frame=per_frame)  # by its own clock, which runs wrong
        self.rate_error, self.jitter_s, self.retry_s = rate_error, jitter_s, retry_s
        self.random = np.random.default_rng(11)
        self.start_ns = SetClock().now_ns()

    def run(
        self, seconds: float, lost: set[int]
    ) -> tuple[list[SampleBlock], np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
        """Return the blocks and the error of each sample's time in ms."""
        blocks, errors, read_ns = [], [], 0
        period_ns = 1e9 / self.node.rate_hz / (1 + self.rate_error)
        for number in range(int(seconds * self.node.rate_hz / self.node.per_frame)):
            frame = self.node.frame()
            end_ns = self.start_ns + (self.node.sequence - 1) * period_ns
            if number in lost:
                continue
            late_s = self.retry_s if self.random.uniform() < 0.2 else 0.0
            read_ns = max(read_ns, round(end_ns + self.random.uniform(0, self.jitter_s + late_s) * 1e9))
            for block in self.part.feed(frame, read_ns):
                true_ns = end_ns - period_ns * np.arange(len(block) - 1, -1, -1)
                blocks.append(block)
                errors.append((block.time_ns - self.start_ns - (true_ns - self.start_ns)) / 1e6)
        return blocks, np.concatenate(errors)


@pytest.mark.slow
@pytest.mark.parametrize(("rate_error", "per_frame", "seconds"), [(0.05, 1, 100), (-0.05, 8, 600)])
def test_times_at_5_percent_and_20_ms_of_jitter(rate_error: float, per_frame: int, seconds: float) -> None:
    air = Air(rate_error, per_frame=per_frame)
    blocks, error_ms = air.run(seconds, set())
    assert np.sqrt(np.mean(error_ms[1000:] ** 2)) < 0.2  # its constant part included
    assert sum(block.lost for block in blocks) == 0
    assert np.all(np.diff(np.concatenate([block.time_ns for block in blocks])) > 0)
    assert (air.part.faults["node_restarted"], air.part.faults["clock_relearned"]) == (0, 0)


@pytest.mark.slow
def test_lost_frames_shift_no_time() -> None:
    """A tenth of all frames, and once five seconds, are lost."""
    random = np.random.default_rng(2)
    lost = set(np.flatnonzero(random.uniform(size=1500) < 0.1).tolist()) | set(range(600, 663))
    air = Air(0.05)
    blocks, error_ms = air.run(100, lost)
    assert sum(block.lost for block in blocks) == 8 * len(
        [number for number in lost if number < air.node.sequence // 8 - 1]
    )
    assert np.abs(error_ms[2000:]).max() < 1.0


@pytest.mark.slow
def test_a_radio_that_is_often_late_by_far_keeps_its_line() -> None:
    """A fifth of the frames is repeated by the radio, and comes up to 0.3 s late."""
    air = Air(0.03, retry_s=0.3)
    _, error_ms = air.run(120, set())
    assert air.part.faults["clock_relearned"] == 0
    assert np.abs(error_ms[6000:]).max() < 1.0
