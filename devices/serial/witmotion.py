"""WitMotion sensors and radio receivers: their stream on a serial port."""

import struct
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Literal

import numpy as np

from devices.block import DeviceInfo, RadioStatus, SampleBlock
from devices.clock import Clock
from devices.sample_clock import SampleClock
from devices.sample_loss import UncountedLoss, lost_in_pause
from devices.saturation import code_limits, mark_saturated
from devices.serial.witmotion_frames import FrameDecoder, Readings
from devices.serial.witmotion_radio_frames import RAD_S_PER_UNIT, RadioFrameDecoder
from devices.serial_port import SYSTEM_FOLDERS, PortFolders, SerialPort
from devices.serial_sensor import SerialSensor, check_settings

FULL_SCALE_G = 16.0
"""Definition: of the protocol."""
UNITS_PER_G = 32768 / FULL_SCALE_G
"""Definition: 16 bits over the range."""
KNOWN_RATE_U = 0.2
"""Share of a period by which the rate's uncertainty may move a sample in `LOSS_S`, so that lost samples are found by time. Basis:
a choice; a lost sample is then five such deviations away."""
LOSS_S = 3.0
"""Basis: a choice; longer than a radio link pauses."""

READ_REGISTER = bytes.fromhex("FF AA 27")
"""WT901BLE protocol: followed by the register as u16; answered by a frame `55 71`."""
TEMPERATURE, BATTERY = 0x40, 0x64
"""Registers: hundredths of a degree Celsius (s16); hundredths of a volt (u16)."""
REQUEST_PERIOD_NS = 5_000_000_000
"""Temperature and battery are asked for in turn: each every ten seconds. Basis: a choice; both change within minutes."""
TEMPERATURE_STALE_NS = 30_000_000_000
"""Basis: three answers."""
CHARGE_PERCENT = (
    (3.96, 100), (3.93, 90), (3.87, 75), (3.82, 60), (3.79, 50), (3.77, 40), (3.73, 30), (3.70, 20), (3.68, 15), (3.50, 10),
    (3.40, 5),
)  # fmt: skip
"""Least voltage, charge. Definition: the maker's table (WT901BLE protocol, battery level)."""
LOW_PERCENT = 15
"""A lower charge is a low battery. Basis: a choice; the two last steps of the maker's table are lower."""

Frames = Literal["standard", "radio"]


def open_witmotion(
    port: str,
    baud: int = 115200,
    *,
    clock: Clock,
    odr_hz: float = 100.0,
    frames: Frames = "standard",
    block_samples: int = 8,
    serial: str | None = None,
    folders: PortFolders = SYSTEM_FOLDERS,
) -> SerialSensor:
    """Return the sensor on a port, not yet opened; see `WitMotionPart` and `SerialPort`. Raises `ValueError`."""
    check_settings(odr_hz, block_samples)
    part = WitMotionPart(odr_hz=odr_hz, frames=frames, serial=serial)
    return SerialSensor(part, SerialPort(port, baud, folders), clock=clock, odr_hz=odr_hz, block_samples=block_samples)


class WitMotionPart:
    """The stream of a WitMotion sensor.

    It has neither sequence numbers nor times: sample times come from the count of frames, see `devices.sample_clock`, and lost
    frames that leave no trace are found by time, see `devices.sample_loss`.
    """

    frame = "acceleration frame"
    advice = "that the sensor sends acceleration"

    def __init__(self, *, odr_hz: float, frames: Frames = "standard", serial: str | None = None) -> None:
        """`odr_hz`: the rate set in the sensor; `frames`: `radio` for the 20-byte frames of Bluetooth Low Energy.

        `serial`: a label of the sensor, for the stream has no number; without it a calibration belongs to the persistent name
        of the port.
        """
        self._odr_hz = odr_hz
        self._serial = serial
        self._decoder = FrameDecoder() if frames == "standard" else RadioFrameDecoder()
        self._behind = 0 if frames == "standard" else 1  # the header of the next frame has arrived, too
        self._sample_clock = SampleClock(odr_hz)
        self._loss = UncountedLoss()
        self._lost_by_time = 0
        self._last_ns: int | None = None
        self._silent = True
        self._requested_ns: int | None = None
        self._next_register = BATTERY
        self._temperature: tuple[int, float] | None = None

    def info(self, port: SerialPort) -> DeviceInfo:
        """Return the properties of the sensor on an open port."""
        radio = self._behind > 0
        return DeviceInfo(
            kind="witmotion",
            device_id=f"witmotion-{self._serial or port.identity}",
            unit="counts",
            odr_hz=self._odr_hz,
            units_per_g=UNITS_PER_G,
            full_scale_g=FULL_SCALE_G,
            gyro_rad_s_per_count=RAD_S_PER_UNIT if radio else None,
            details={
                "port": str(port),
                "baud": str(port.baud),
                "resolution": f"{1000 / UNITS_PER_G:.3f} mg",
                "checksum": "none: a flipped bit within a reading is not seen" if radio else "8-bit sum",
            },
        )

    def reset(self) -> None:
        """Discard what was received, after the port was opened; counts of faults remain."""
        self._decoder.reset()
        self._silent = True
        self._requested_ns = None

    def bytes_until(self, samples: int) -> int:
        """Return the number of bytes that are missing until the newest of so many samples is complete."""
        return self._decoder.bytes_until(samples)

    def request(self, now_ns: int) -> bytes:
        """Ask for temperature and battery in turn, which radio frames do not contain."""
        if not isinstance(self._decoder, RadioFrameDecoder):
            return b""
        if self._requested_ns is not None and now_ns - self._requested_ns < REQUEST_PERIOD_NS:
            return b""
        self._requested_ns = now_ns
        self._next_register = BATTERY if self._next_register == TEMPERATURE else TEMPERATURE
        return READ_REGISTER + struct.pack("<H", self._next_register)

    @property
    def bytes_since_frame(self) -> int:
        """Number of bytes since the beginning of the newest acceleration frame, or since the start of the stream."""
        return self._decoder.bytes_since_sample

    @property
    def faults(self) -> Mapping[str, int]:
        """Broken frames, false starts, discarded bytes, restarts of the sample clock, and samples found missing by time."""
        return {
            **self._decoder.faults,
            "clock_relearned": self._sample_clock.relearned,
            "lost_by_time": self._lost_by_time,
        }

    def feed(self, data: bytes, read_ns: int) -> list[SampleBlock]:
        """Return the blocks that bytes complete; no bytes: half a second of silence."""
        self._silent = self._silent or not data
        readings = self._decoder.feed(data)
        status = self._take_registers(read_ns)
        if not len(readings):
            return []
        blocks = list(self._make_blocks(readings, read_ns, status))
        self._silent = False
        return blocks

    def _make_blocks(self, readings: Readings, read_ns: int, status: RadioStatus | None) -> Iterator[SampleBlock]:
        """Return blocks with sample times; after lost samples a new block begins."""
        if self._silent:
            self._sample_clock.restart()
            self._loss.restart()
        missing = readings.missing_before
        place = np.cumsum(missing + 1) - 1 - missing[0]  # lost frames are counted
        count = int(place[-1]) + 1
        by_time = self._find_loss(int(missing[0]) + count, read_ns)
        time_ns = self._sample_clock.stamp(count, read_ns, lost=int(missing[0]) + by_time, behind=self._behind)[place]
        starts = [0, *(np.flatnonzero(missing[1:]) + 1).tolist(), len(readings)]
        for first, end in pairwise(starts):
            lost = int(readings.lost_before[first])
            if first == 0:
                lost = lost_in_pause(self._last_ns, int(time_ns[0]), self._odr_hz) if self._silent else lost + by_time
            yield SampleBlock(
                time_ns=time_ns[first:end],
                raw=readings.counts[first:end],
                temperature_c=self._temperature_c(readings.temperature_c[first:end], read_ns),
                lost=lost,
                invalid=int(readings.invalid_before[first]),
                gyro_counts=None if readings.gyro_counts is None else readings.gyro_counts[first:end],
                radio=status if first == 0 else None,
                saturated=mark_saturated(readings.counts[first:end], *code_limits(16)),
            )
        self._last_ns = int(time_ns[-1])

    def _find_loss(self, count: int, read_ns: int) -> int:
        """Return the number of samples that were lost without a trace, by the delay of the newest one."""
        clock = self._sample_clock
        expected_ns, rate_hz, rate_u_hz = (
            clock.due_ns(count + self._behind),
            clock.measured_rate_hz,
            clock.measured_rate_u_hz,
        )
        if expected_ns is None or rate_hz is None or rate_u_hz is None or rate_u_hz * LOSS_S > KNOWN_RATE_U:
            return 0
        lost = self._loss.add(read_ns - expected_ns, read_ns, 1e9 / rate_hz)
        self._lost_by_time += lost
        return lost

    def _temperature_c(
        self, of_frames_c: np.ndarray[tuple[int, ...], np.dtype[np.float64]], read_ns: int
    ) -> float | None:
        """Return the temperature of the frames where they have one, else the latest answer."""
        if not np.isnan(of_frames_c).any():
            return float(of_frames_c.mean())
        if self._temperature is None or read_ns - self._temperature[0] > TEMPERATURE_STALE_NS:
            return None
        return self._temperature[1]

    def _take_registers(self, read_ns: int) -> RadioStatus | None:
        """Evaluate the answers to requests."""
        if not isinstance(self._decoder, RadioFrameDecoder):
            return None
        registers, self._decoder.registers = self._decoder.registers, {}
        if TEMPERATURE in registers:
            self._temperature = read_ns, np.int16(np.uint16(registers[TEMPERATURE]).view(np.int16)).item() / 100
        return battery_status(registers[BATTERY] / 100) if BATTERY in registers else None


def battery_status(battery_v: float) -> RadioStatus:
    """Return the state of a WitMotion sensor's lithium cell by its voltage."""
    percent = next((percent for least_v, percent in CHARGE_PERCENT if battery_v >= least_v), 0)
    return RadioStatus(battery_v=battery_v, battery_percent=float(percent), battery_low=percent < LOW_PERCENT)
