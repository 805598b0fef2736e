"""The sampling thread with a scripted device: it survives what the device does, counts it, and never waits for others."""

import time
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.device import EndOfRecording
from devices.errors import TransferError
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister
from gateway.daemon.sampling.sampler import Sampler, SamplerItem
from tests.waiting import PATIENCE_S, wait_until

INFO = DeviceInfo(kind="test", device_id="t-1", unit="counts", odr_hz=100.0, units_per_g=1000.0)


def block(n: int = 2) -> SampleBlock:
    return SampleBlock(time_ns=np.arange(n, dtype=np.int64), raw=np.zeros((n, 3), dtype=np.int32))


class Scripted:
    """Gives what the script says, then ends."""

    def __init__(
        self, reads: Sequence[SampleBlock | TransferError | None], opens: Sequence[DeviceInfo | TransferError] = ()
    ) -> None:
        self.reads, self.opens, self.closed = list(reads), list(opens), 0

    def open(self) -> DeviceInfo:
        step = self.opens.pop(0)
        if isinstance(step, Exception):
            raise step
        return step

    def read(self) -> SampleBlock | None:
        if not self.reads:
            raise EndOfRecording
        step = self.reads.pop(0)
        if isinstance(step, Exception):
            raise step
        return step

    def close(self) -> None:
        self.closed += 1

    faults: Mapping[str, int] = MappingProxyType({})


def run(device: Scripted, info: DeviceInfo = INFO, size: int = 64) -> tuple[Sampler, list[SamplerItem]]:
    queue = BoundedQueue[SamplerItem](size)
    sampler = Sampler(device, info, queue, FaultRegister())
    sampler.start()
    assert sampler.ended.wait(PATIENCE_S)
    sampler.join(PATIENCE_S)
    items = []
    while (item := queue.get(0.0)) is not None:
        items.append(item)
    return sampler, items


def test_blocks_are_forwarded_in_order_and_the_device_is_closed() -> None:
    blocks = [block(1), block(2), block(3)]
    device = Scripted([blocks[0], None, blocks[1], blocks[2]])
    _, items = run(device)
    assert [len(item) for item in items if isinstance(item, SampleBlock)] == [1, 2, 3]
    assert len(items) == 3
    assert device.closed == 1


@pytest.mark.slow
def test_a_lost_device_is_opened_again_until_it_answers() -> None:
    other = DeviceInfo(kind="test", device_id="t-2", unit="counts", odr_hz=100.0, units_per_g=1000.0)
    device = Scripted([block(), TransferError("gone"), block()], [TransferError("still gone"), other])
    sampler, items = run(device)
    first, reopened, last = items
    assert isinstance(first, SampleBlock)
    assert isinstance(reopened, DeviceInfo)
    assert isinstance(last, SampleBlock)
    assert reopened.device_id == "t-2"
    assert sampler.reopened == 1
    assert not sampler.recovering


def at(first_ns: int, n: int = 2) -> SampleBlock:
    return SampleBlock(time_ns=first_ns + np.arange(n) * 10_000_000, raw=np.zeros((n, 3), dtype=np.int32))


@pytest.mark.slow
def test_samples_that_an_absent_device_would_have_made_are_counted_as_lost() -> None:
    device = Scripted(
        [at(0), TransferError("gone"), at(8_010_000_000), at(8_030_000_000)], [TransferError("still gone"), INFO]
    )
    _, items = run(device)
    lost = [item.lost for item in items if isinstance(item, SampleBlock)]
    assert lost == [0, 799, 0]  # 8 s at 100 Hz, of which the sample at 8.01 s came


@pytest.mark.slow
def test_a_device_that_did_not_answer_at_start_is_opened_when_it_does() -> None:
    device = Scripted([block()], [TransferError("gone"), INFO])
    queue, faults = BoundedQueue[SamplerItem](8), FaultRegister()
    sampler = Sampler(device, None, queue, faults)
    assert sampler.recovering
    sampler.start()
    assert sampler.ended.wait(PATIENCE_S)
    assert isinstance(queue.get(0.0), DeviceInfo)
    assert isinstance(queue.get(0.0), SampleBlock)
    assert faults.counts == {"device_failures": 1}
    assert faults.standing == {}


def test_a_full_queue_drops_the_newest_and_counts_its_samples() -> None:
    sampler, items = run(Scripted([block(5) for _ in range(10)]), size=4)
    assert len(items) == 4
    assert sampler.lost_in_queue == 30


def test_a_replay_waits_for_its_reader() -> None:
    queue = BoundedQueue[SamplerItem](1)
    patient = DeviceInfo(kind="t", device_id="t", unit="g", odr_hz=1.0, units_per_g=1.0, can_wait=True)
    sampler = Sampler(Scripted([block() for _ in range(5)]), patient, queue, FaultRegister())
    sampler.start()
    got = 0
    while got < 5:
        time.sleep(0.01)
        got += queue.get(1.0) is not None
    sampler.join(PATIENCE_S)
    assert sampler.lost_in_queue == 0


def test_the_sampler_stops_while_the_device_is_lost() -> None:
    queue = BoundedQueue[SamplerItem](4)
    device = Scripted([TransferError("gone")], [TransferError("gone")] * 1000)
    sampler = Sampler(device, INFO, queue, FaultRegister())
    sampler.start()
    wait_until(lambda: sampler.recovering, "the device to be away")
    sampler.stop()
    sampler.join(PATIENCE_S)
    assert not sampler.is_alive()


@pytest.mark.parametrize("size", [1, 3])
def test_the_bounded_queue_counts_dropped_items(size: int) -> None:
    queue = BoundedQueue[int](size)
    assert [queue.put(i) for i in range(5)] == [True] * size + [False] * (5 - size)
    assert queue.dropped == 5 - size
    assert [queue.get(0.0) for _ in range(size + 1)] == [*range(size), None]
