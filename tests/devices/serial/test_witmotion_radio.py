"""A Bluetooth sensor behind its receiver: battery, temperature, rates, and frames that the radio lost without a trace."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.block import RadioStatus
from devices.serial.witmotion import WitMotionPart, battery_status, open_witmotion
from devices.serial_sensor import SerialSensor
from tests.devices.serial.serial_peer import Peer, SetClock
from tests.devices.serial.witmotion_wire import radio_answer, radio_stream, stream
from tests.values import present

END = b"\x55\x61"


@pytest.fixture
def device(peer: Peer, clock: SetClock) -> Iterator[SerialSensor]:
    device = open_witmotion(str(peer.name), clock=clock, odr_hz=50, frames="radio", block_samples=5)
    device.open()
    yield device
    device.close()


@pytest.mark.slow
def test_temperature_and_battery_are_asked_for_in_turn(device: SerialSensor, peer: Peer, clock: SetClock) -> None:
    peer.send(radio_stream(range(5)) + END)
    first = present(device.read())
    assert (first.temperature_c, first.radio) == (None, None)
    assert peer.received(100) == bytes.fromhex("FF AA 27 40 00")  # WT901BLE protocol, read temperature
    clock.sleep_s(5.0)
    peer.send(radio_stream(range(5, 9))[2:] + radio_answer(0x40, 0x10000 - 150) + END)
    assert present(device.read()).temperature_c == -1.5
    assert peer.received(100) == bytes.fromhex("FF AA 27 64 00")
    peer.send(radio_stream(range(9, 13))[2:] + radio_answer(0x64, 369) + END)
    block = present(device.read())
    assert block.radio == RadioStatus(battery_v=3.69, battery_percent=15.0, battery_low=False)
    assert block.temperature_c == -1.5
    peer.send(radio_stream(range(13, 18))[2:] + END)
    assert present(device.read()).radio is None
    clock.sleep_s(31.0)
    assert device.read() is None
    peer.send(radio_stream(range(18, 23))[2:] + END)
    assert present(device.read()).temperature_c is None  # stale


def test_gyroscope_readings_come_with_the_samples(device: SerialSensor, peer: Peer) -> None:
    peer.send(radio_stream(range(5)) + END)
    block = present(device.read())
    assert present(block.gyro_counts).shape == (5, 3)
    assert block.raw.shape == (5, 3)


@pytest.mark.parametrize(
    ("battery_v", "percent", "low"),
    [(4.15, 100, False), (3.80, 50, False), (3.69, 15, False), (3.6, 10, True), (3.2, 0, True)],
)
def test_charge_by_the_maker_s_table(battery_v: float, percent: float, low: bool) -> None:
    assert battery_status(battery_v) == RadioStatus(battery_v, percent, low)


class Air:
    """Frames of a sensor that runs at its own rate, which reach the gateway late, or not at all."""

    def __init__(self, part: WitMotionPart, frames: str, rate_hz: float, seconds: float, jitter_s: float) -> None:
        self.part, self.frames = part, frames
        self.random = np.random.default_rng(8)
        self.made_ns = 1_700_000_000_000_000_000 + np.rint(1e9 / rate_hz * np.arange(int(seconds * rate_hz))).astype(
            np.int64
        )
        self.jitter_s = jitter_s

    def run(self, lost: set[int], per_read: int = 4) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        """Return (time, true time) of the samples that arrived, and the number that is said to be lost."""
        kept = [k for k in range(len(self.made_ns)) if k not in lost]
        read_ns = 0
        times: list[int] = []
        counted = 0
        for first in range(0, len(kept) - per_read, per_read):
            part = kept[first : first + per_read]
            data = b"".join(self._frame(k) for k in part)
            if self.frames == "radio":
                data = data + END if first == 0 else data[2:] + END
                newest = kept[first + per_read]  # its header came, too
            else:
                newest = part[-1]
            read_ns = max(read_ns, int(self.made_ns[newest] + self.random.uniform(0, self.jitter_s) * 1e9))
            for block in self.part.feed(data, read_ns):
                times += block.time_ns.tolist()
                counted += block.lost
        return np.array(times), self.made_ns[np.array(kept[: len(times)])], counted

    def _frame(self, k: int) -> bytes:
        numbers = range(k % 30000, k % 30000 + 1)
        return radio_stream(numbers) if self.frames == "radio" else stream(numbers)


def rms_ms(times_ns: NDArray[np.int64], true_ns: NDArray[np.int64], after_s: float) -> float:
    """Return the rms of the error, its constant part included, of the samples made `after_s` or later."""
    late = true_ns > true_ns[0] + after_s * 1e9
    return float(np.sqrt(np.mean(((times_ns - true_ns)[late] / 1e6) ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frames", "odr_hz", "rate_error", "seconds"), [("standard", 100.0, 0.05, 200), ("radio", 50.0, -0.05, 600)]
)
def test_times_of_frames_read_up_to_20_ms_late(frames: str, odr_hz: float, rate_error: float, seconds: int) -> None:
    part = WitMotionPart(odr_hz=odr_hz, frames="radio" if frames == "radio" else "standard")
    times_ns, true_ns, lost = Air(part, frames, odr_hz * (1 + rate_error), seconds, 0.02).run(set())
    assert lost == 0
    assert rms_ms(times_ns, true_ns, after_s=10) < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("gone", [1, 3, 30])
@pytest.mark.parametrize(("frames", "odr_hz"), [("standard", 100.0), ("radio", 50.0)])
def test_whole_frames_that_the_radio_lost_are_found_by_time(frames: str, odr_hz: float, gone: int) -> None:
    part = WitMotionPart(odr_hz=odr_hz, frames="radio" if frames == "radio" else "standard")
    first = int(60 * odr_hz)
    air = Air(part, frames, odr_hz * 1.03, 150, 0.02)
    times_ns, true_ns, lost = air.run(set(range(first, first + gone)) | set(range(2 * first, 2 * first + gone)))
    assert lost == 2 * gone
    assert part.faults["lost_by_time"] == 2 * gone
    assert part.faults["clock_relearned"] == 0
    after = true_ns > air.made_ns[first] + 5e9
    after &= (true_ns < air.made_ns[2 * first]) | (true_ns > air.made_ns[2 * first] + 5e9)
    error_ms = (times_ns - true_ns)[after] / 1e6
    assert np.abs(error_ms).max() < 1.0
    assert np.all(np.diff(times_ns) > 0)


@pytest.mark.slow
def test_delays_without_a_loss_are_no_loss() -> None:
    """A host that stalls for a quarter of a second every few seconds."""
    part = WitMotionPart(odr_hz=100.0)
    air = Air(part, "standard", 100.0, 120, 0.02)
    stalled = (air.made_ns // 250_000_000 % 13 == 0) & (np.arange(len(air.made_ns)) > 2000)
    late_ns = np.where(stalled, 250_000_000 - air.made_ns % 250_000_000, 0)
    counted, read_ns, times = 0, 0, []
    for first in range(0, len(air.made_ns) - 4, 4):
        last = first + 3
        read_ns = max(read_ns, int(air.made_ns[last] + late_ns[last] + air.random.uniform(0, 0.02) * 1e9))
        for block in part.feed(stream(range(first % 30000, first % 30000 + 4)), read_ns):
            counted += block.lost
            times += block.time_ns.tolist()
    assert counted == 0
    assert np.abs(np.array(times) - air.made_ns[: len(times)])[2000:].max() < 1e6
