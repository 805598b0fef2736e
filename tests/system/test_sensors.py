"""Real sensors the whole way: a chip at the `i2c_rdwr` boundary, a radio on a pseudo-terminal."""

import math
import os
import pty
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest

from devices.block import DeviceInfo
from devices.i2c.chips import CHIPS
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from devices.pendulum.pendulum import start_motion
from devices.simulated.crane import Crane
from gateway.calibration.correction import correction_for
from gateway.configuration.loading import validate
from gateway.messages import Condition, Log, Message, Swing
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker
from gateway.pipeline.pipeline import Pipeline
from tests.devices.i2c.adxl355_chip import Adxl355Chip
from tests.devices.i2c.i2c_chip import FakeClock, Signal
from tests.devices.i2c.part_rig import PARTS, Part
from tests.devices.serial.witmotion_wire import frame
from tests.system.conftest import JoinBus, StartGateway
from tests.values import present
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

LENGTH_M, POSITION_M, SWING_DEG = 6.0, 4.0, 5.0


def swinging_signal(seconds: float) -> Signal:
    """Specific force of a free swing at any time of a run, by interpolation of a dense track."""
    crane = Crane(
        length_m=LENGTH_M,
        position_m=POSITION_M,
        gravity_m_s2=9.80665,
        motion=start_motion(0.8 * math.radians(SWING_DEG), 0.6 * math.radians(SWING_DEG), 0.0, 0.0),
    )
    random = np.random.default_rng(5)
    grid_s = np.arange(0, seconds, 0.005)
    track_g = np.concatenate([crane.specific_force_m_s2(part) for part in np.array_split(grid_s, 100)]) / 9.80665

    def signal(time_s: float) -> tuple[float, float, float]:
        index = min(int(time_s / 0.005), len(grid_s) - 2)
        share = time_s / 0.005 - index
        x_g, y_g, z_g = (1 - share) * track_g[index] + share * track_g[index + 1] + random.normal(0, 2e-4, 3)
        return x_g, y_g, z_g

    return signal


def processed(
    device: FifoAccelerometer, info: DeviceInfo, clock: FakeClock, section: dict[str, object]
) -> list[Message | Log]:
    """What the pipeline makes of half a minute of an open device, by its section of the configuration."""
    table = {"device": section, "rope": {"length_m": 7.0}, "housing": {"position_m": POSITION_M}}
    configuration = validate(table, "test")
    pipeline = Pipeline(configuration, info, correction_for(info, configuration.device.axes, None), HeaderMaker())
    results: list[Message | Log] = []
    while clock.elapsed_s < 30:
        if (block := device.read()) is not None:
            results += [each.message for each in pipeline.process(block, ClockState("synchronised", 0)).messages]
    return results


@pytest.mark.parametrize("rate_error", [0.0, 0.03])
def test_adxl355_from_the_bus_to_the_swing(rate_error: float) -> None:
    """A chip that runs 3 % fast still gives the right swing and period: times come from the host's clock."""
    clock = FakeClock(0.0005)
    chip = Adxl355Chip(clock, swinging_signal(60.0), rate_error=rate_error)
    device = FifoAccelerometer(
        CHIPS["adxl355"](125.0, 2), 1, 0x1D, clock=clock, block_samples=8, open_bus=lambda _: chip
    )
    results = processed(device, device.open(), clock, {"kind": "adxl355"})
    swings = [each for each in results if isinstance(each, Swing)]
    conditions = [each for each in results if isinstance(each, Condition)]
    low_deg, high_deg = present(swings[-1].coverage95_deg)
    u_deg = present(swings[-1].u_deg)
    assert low_deg < SWING_DEG < high_deg
    assert u_deg < 0.08 * SWING_DEG  # scale and cross-axis of a part that nobody has calibrated
    assert swings[-1].phi_max_deg == pytest.approx(SWING_DEG, abs=u_deg)
    assert swings[-1].period_s == pytest.approx(2 * math.pi * math.sqrt(LENGTH_M / 9.80665), rel=0.005)
    assert conditions[-1].verdict == "swinging"
    assert conditions[-1].calibration == "uncalibrated"


@pytest.mark.parametrize("part", PARTS, ids=str)
def test_every_part_from_the_bus_to_the_swing(part: Part) -> None:
    """With the noise of its data sheet and a rate that is 3 % too slow, every part gives an interval that holds the swing."""
    clock = FakeClock(0.0005)
    track = swinging_signal(60.0)
    chip = part.chip(clock, rate_error=-0.03)
    device = FifoAccelerometer(
        CHIPS[part.kind](part.odr_hz, part.range_g),
        1,
        chip.address,
        clock=clock,
        block_samples=8,
        open_bus=lambda _: chip,
    )
    info = device.open()
    random = np.random.default_rng(7)
    noise_g = present(info.noise_g)

    def noisy(time_s: float) -> tuple[float, float, float]:
        x_g, y_g, z_g = np.array(track(time_s)) + random.normal(0, noise_g, 3)
        return float(x_g), float(y_g), float(z_g)

    chip.signal = noisy
    section = {"kind": part.kind, "odr_hz": part.odr_hz, "range_g": part.range_g}
    swings = [each for each in processed(device, info, clock, section) if isinstance(each, Swing)]
    low_deg, high_deg = present(swings[-1].coverage95_deg)
    assert low_deg < SWING_DEG < high_deg
    # noise of a data sheet, five swings, a rope whose length may change: twice the uncertainty of the period is 3 %
    assert swings[-1].period_s == pytest.approx(2 * math.pi * math.sqrt(LENGTH_M / 9.80665), rel=0.03)


class Radio:
    """A receiver on a pseudo-terminal that a link names; it can be pulled out and put back."""

    def __init__(self, link: Path, lean_deg: float) -> None:
        self.link = link
        self.force_g = (math.sin(math.radians(lean_deg)), 0.0, math.cos(math.radians(lean_deg)))
        self._stopping = threading.Event()

    def plug_in(self) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(slave))
        self._slave = slave
        self._stopping.clear()
        self._sender = threading.Thread(target=self._send)
        self._sender.start()

    def _send(self) -> None:
        os.write(self._master, b"\x55\x51garbage of a receiver that wakes up\x55")
        due_s = time.monotonic()
        while not self._stopping.is_set():
            os.write(self._master, frame(0x51, *(round(2048 * each) for each in self.force_g), 2500))
            due_s += 0.01
            time.sleep(max(0.0, due_s - time.monotonic()))

    def pull_out(self) -> None:
        self._stopping.set()
        self._sender.join()
        self.link.unlink()
        os.close(self._slave)
        os.close(self._master)


def test_witmotion_radio_is_lost_and_found_again(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    radio = Radio(tmp_path / "radio", lean_deg=5.0)
    radio.plug_in()
    try:
        gateway = start_gateway(
            f'[device]\nkind = "witmotion"\nport = "{radio.link}"\nodr_hz = 100\n[housing]\nposition_m = 5\n'
        )
        peer = join_bus(gateway.endpoint)
        tilt = peer.wait_for("tilt", lambda message: abs(message["axial_deg"] - 5.0) < 0.1)
        assert tilt["temperature_c"] == pytest.approx(25.0)
        radio.pull_out()
        stale = peer.wait_for("condition", lambda message: "stale" in message["reasons"][0])
        assert not stale["trusted"]
        assert peer.wait_for("health", lambda message: message["state"] == "recovering")
        tilts = len(peer.messages("tilt"))
        radio.plug_in()
        peer.wait_for("health", lambda message: message["faults"].get("device_reopened"))
        wait_until(lambda: len(peer.messages("tilt")) >= tilts + 10, "ten more tilts")
        assert peer.messages("tilt")[-1]["axial_deg"] == pytest.approx(5.0, abs=0.1)
        assert gateway.process.poll() is None
    finally:
        radio.pull_out()
