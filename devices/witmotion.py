"""WitMotion sensors and radio receivers: their standard stream on a serial port."""

from collections import deque
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.errors import DeviceError, TransferError
from devices.sample_clock import SampleClock
from devices.serial_port import BY_ID, SerialPort
from devices.witmotion_frames import FrameDecoder, Readings

FULL_SCALE_G = 16.0
UNITS_PER_G = 32768 / FULL_SCALE_G
FRAMELESS_LIMIT_BYTES = 2048
"""This many bytes without an acceleration frame are more than a disturbance."""
LONGEST_WAIT_S = 0.5
RATE_WINDOW_S = 10.0
RATE_TOLERANCE = 0.15
"""Larger than the deviation of a sensor's clock, smaller than the distance to the next rate that can be set."""


class WitMotion:
    """A sensor or radio receiver on a serial port, which is found again after it was unplugged.

    The stream has neither sequence numbers nor times: sample times come from the count of frames, see `devices.sample_clock`.
    """

    def __init__(
        self,
        port: str,
        baud: int = 115200,
        *,
        clock: Clock,
        odr_hz: float = 100.0,
        block_samples: int = 8,
        serial: str | None = None,
        by_id: Path = BY_ID,
    ) -> None:
        """`odr_hz`: the rate set in the sensor; `block_samples`: usual length of a block.

        `serial`: a label of the sensor, for the stream has no number; without it a calibration belongs to the persistent name
        of the port. `by_id`: the folder of those names. Raises `ValueError`.
        """
        if not odr_hz > 0 or block_samples < 1:
            raise ValueError(
                f"{block_samples} samples per block at {odr_hz:g} Hz are impossible; give at least 1 and a rate above 0"
            )
        self._port = SerialPort(port, baud, by_id)
        self._baud = baud
        self._odr_hz = odr_hz
        self._block_samples = block_samples
        self._serial = serial
        self._clock = clock
        self._decoder = FrameDecoder()
        self._sample_clock = SampleClock(odr_hz)
        self._blocks: deque[SampleBlock] = deque()
        self._last_ns: int | None = None
        self._silent = True
        self._counted_from_ns = 0
        self._counted = 0
        self._disconnects = 0

    def open(self) -> DeviceInfo:
        """Open the port, without waiting for a frame: a radio may still be asleep."""
        self._port.open(LONGEST_WAIT_S)
        self._decoder.reset()
        self._blocks.clear()
        self._silent = True
        return DeviceInfo(
            kind="witmotion",
            device_id=f"witmotion-{self._serial or self._port.identity}",
            unit="counts",
            odr_hz=self._odr_hz,
            units_per_g=UNITS_PER_G,
            full_scale_g=FULL_SCALE_G,
            details={"port": str(self._port), "baud": str(self._baud), "resolution": f"{1000 / UNITS_PER_G:.3f} mg"},
        )

    def read(self) -> SampleBlock | None:
        """Return the next block.

        Raises `TransferError` when the port has gone, `DeviceError` when the bytes contain no frames, or frames at another rate
        than `odr_hz`.
        """
        if not self._blocks:
            self._receive()
        return self._blocks.popleft() if self._blocks else None

    def close(self) -> None:
        """Release the port."""
        self._port.close()

    @property
    def faults(self) -> Mapping[str, int]:
        """Broken frames, false starts, discarded bytes, restarts of the sample clock, and disconnections."""
        return {
            **self._decoder.faults,
            "clock_relearned": self._sample_clock.relearned,
            "disconnect": self._disconnects,
        }

    def _receive(self) -> None:
        try:
            data = self._port.read(self._decoder.bytes_until(self._block_samples))
        except TransferError:
            self._disconnects += 1
            raise
        read_ns = self._clock.now_ns()
        readings = self._decoder.feed(data)
        self._silent = self._silent or not data
        if len(readings):
            self._check_rate(readings, read_ns)
            self._blocks.extend(self._make_blocks(readings, read_ns))
            self._silent = False
        elif self._decoder.bytes_since_sample >= FRAMELESS_LIMIT_BYTES:
            none = (
                f"{self._port}: no acceleration frame in {self._decoder.bytes_since_sample} bytes at {self._baud} baud"
            )
            raise DeviceError(f"{none}; check the baud rate, and that the sensor sends acceleration")

    def _check_rate(self, readings: Readings, read_ns: int) -> None:
        """Raise `DeviceError` for a wrong `odr_hz`, which would give plausible but wrong sample times."""
        if self._silent:
            self._counted_from_ns, self._counted = read_ns, 0
            return
        self._counted += len(readings) + int(readings.missing_before.sum())
        elapsed_s = (read_ns - self._counted_from_ns) / 1e9
        if elapsed_s < RATE_WINDOW_S:
            return
        rate_hz = self._counted / elapsed_s
        self._counted_from_ns, self._counted = read_ns, 0
        if abs(rate_hz / self._odr_hz - 1) > RATE_TOLERANCE:
            came = f"{rate_hz:.1f} samples/s arrive, but odr_hz is {self._odr_hz:g}"
            raise DeviceError(f"{self._port}: {came}; set odr_hz to the sensor's rate, or bring the radio nearer")

    def _make_blocks(self, readings: Readings, read_ns: int) -> Iterator[SampleBlock]:
        """Return blocks with sample times; after lost samples a new block begins."""
        if self._silent:
            self._sample_clock.restart()
        missing = readings.missing_before
        place = np.cumsum(missing + 1) - 1 - missing[0]  # lost frames are counted
        time_ns = self._sample_clock.stamp(int(place[-1]) + 1, read_ns, lost=int(missing[0]))[place]
        starts = [0, *(np.flatnonzero(missing[1:]) + 1).tolist(), len(readings)]
        for first, end in pairwise(starts):
            lost = int(readings.lost_before[first])
            if first == 0 and self._silent:
                lost = self._lost_in_silence(int(time_ns[0]))
            yield SampleBlock(
                time_ns=time_ns[first:end],
                raw=readings.counts[first:end],
                temperature_c=float(readings.temperature_c[first:end].mean()),
                lost=lost,
                invalid=int(readings.invalid_before[first]),
            )
        self._last_ns = int(time_ns[-1])

    def _lost_in_silence(self, first_ns: int) -> int:
        """Return the number of samples in a pause, by its length."""
        if self._last_ns is None:
            return 0
        return max(round((first_ns - self._last_ns) / 1e9 * self._odr_hz) - 1, 0)
