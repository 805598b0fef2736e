"""Analog Devices ADXL355 and ADXL357: 20-bit triaxial MEMS accelerometers, their registers and decoding.

Registers and tables by the data sheets ADXL354/ADXL355 Rev. D and ADXL356/ADXL357 Rev. C, sections "Register map" and "Register
descriptions". Registers, rates, scale and temperature agree with Linux, adxl355_core.c (which rounds the scale), those of the
ADXL357 with the driver in .NET IoT. Not confirmed by a second source: noise, zero-g offset and temperature coefficients, the
limits of the ADXL357.

The FIFO holds 96 entries of 3 bytes, one per axis in the order x y z: 20 bits of two's complement, left-justified and big-endian.
The two lowest bits of an entry mark an x entry and an empty FIFO.
"""

import math
import re
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo
from devices.clock import Clock
from devices.errors import TransferError
from devices.i2c.accelerometer_chip import (
    AccelerometerChip,
    FifoLevel,
    ImplausibleStatusError,
    SampleRun,
    SelfTest,
    Setting,
)
from devices.i2c.bus import I2cPart
from devices.i2c.chips import ADXL355_KIND, ChipKind, Identity
from devices.saturation import code_limits

REVID, STATUS, TEMP2, FIFO_DATA = 0x03, 0x04, 0x06, 0x11
FILTER, RANGE, POWER_CTL, SELF_TEST, RESET = 0x28, 0x2C, 0x2D, 0x2E, 0x2F
RESET_CODE = 0x52
STANDBY, MEASURE = 0x01, 0x00
RANGE_HIGH_SPEED = 0x80
"""The default of the other bits of the RANGE register: I2C high-speed mode allowed."""
OVERRUN, NVM_BUSY, STATUS_UNUSED = 0x04, 0x10, 0xE0

RATE_CODES = {rate_hz: code for code, rate_hz in enumerate(ADXL355_KIND.rates_hz)}
"""Definition: codes of the FILTER register (data sheet)."""
MAX_READ_SAMPLES = 16
"""Samples of a block at most. Basis: half of the FIFO, so that a late read loses none."""
ENTRIES_MARGIN = 3
"""The FIFO level may exceed the FIFO's size by this many entries; a higher one is a transfer error. Basis: one sample, which may
come while the level is read."""
RESET_NS, RESET_POLL_S = 200_000_000, 0.002
"""Longest wait for a reset, and pause between two looks. Basis: a choice; a reset takes some ms, and an absent part is told
soon."""
TEMPERATURE_READS = 4
"""Basis: a choice; the two bytes are not latched together, and a carry between them is rare."""
SELF_TEST_MODE, SELF_TEST_FORCE = 0x01, 0x02
SELF_TEST_LIMITS_G = ((0.1, 0.6), (0.1, 0.6), (0.5, 3.0))
"""Data sheet of the ADXL355; a change outside is told as a warning."""


@dataclass(frozen=True, slots=True)
class Variant:
    """The figures in which the ADXL355 and the ADXL357 differ."""

    units_per_g: dict[int, float]
    """By range in g, in the order of the codes 1, 2, 3 of the RANGE register."""
    noise_g_per_root_hz: float
    zero_g_offset_g: float
    zero_g_offset_g_per_k: float
    temperature_25_c: int
    """Reading at 25 °C."""
    self_test: SelfTest | None


SELF_TEST_355 = SelfTest(
    SELF_TEST,
    off_bits=SELF_TEST_MODE,
    on_bits=SELF_TEST_MODE | SELF_TEST_FORCE,
    limits_g=lambda _: SELF_TEST_LIMITS_G,
    odr_hz=125.0,
    range_g=8,
    either_sign=True,
)
"""Definition: the rate and the range in which the test is run."""
ADXL355 = Variant({2: 256000.0, 4: 128000.0, 8: 64000.0}, 22.5e-6, 0.075, 0.15e-3, 1885, SELF_TEST_355)
"""Data sheet ADXL354/ADXL355."""
ADXL357 = Variant({10: 51200.0, 20: 25600.0, 40: 12800.0}, 75e-6, 0.375, 0.75e-3, 1852, None)
"""Data sheet ADXL356/ADXL357."""
SCALE_FACTOR_PER_K = 1e-4
"""Data sheets: 0.01 % per kelvin."""

ENTRY_BYTES, SAMPLE_BYTES = 3, 9
"""Definition: an entry has an axis of 20 bits, a sample three of them (data sheet)."""
FIFO_ENTRIES = 96
"""Data sheet: 96 entries, 32 samples."""
MARKS = bytes(b"oxee"[byte & 3] for byte in range(256))
"""Kind of an entry by its third byte: x, another axis, empty."""
EMPTY = ord("e")
ALIGNED = b"xoo" * FIFO_ENTRIES
SEGMENTS = re.compile(rb"(?P<whole>(?:xoo)+)|(?P<tail>xo?\Z)|(?P<broken>[xo]o*)")
"""Complete samples; an incomplete sample at the end; entries of a sample that lacks others."""


def temperature_c(raw: int, at_25_c: int = ADXL355.temperature_25_c) -> float:
    """Return degrees Celsius for a 12-bit reading: -9.05 per degree from the nominal reading at 25 °C."""
    return 25.0 + (raw - at_25_c) / -9.05


def noise_g(odr_hz: float, noise_g_per_root_hz: float = ADXL355.noise_g_per_root_hz) -> float:
    """Return the typical noise per sample and axis, 1 sigma: noise density times the root of the noise bandwidth.

    The part's filter has its -3 dB point at a quarter of the rate. Its noise bandwidth is between that (an ideal filter) and
    pi/2 times that (a first-order filter); the upper value is used.
    """
    return noise_g_per_root_hz * math.sqrt(math.pi / 2 * odr_hz / 4)


def split_entries(entries: bytes) -> tuple[list[SampleRun], bytes]:
    """Return the complete samples, and the entries of an incomplete last sample.

    Empty entries are removed; a sample that lacks entries is skipped up to the next x entry.
    """
    marks = entries[2::ENTRY_BYTES].translate(MARKS)
    if ALIGNED.startswith(marks) and len(entries) % SAMPLE_BYTES == 0:
        return [SampleRun(decode_counts(entries))] if entries else [], b""
    filled = b"".join(entries[3 * i : 3 * i + 3] for i, mark in enumerate(marks) if mark != EMPTY)
    runs, tail, lost = [], b"", 0
    for stretch in SEGMENTS.finditer(filled[2::ENTRY_BYTES].translate(MARKS)):
        part = filled[3 * stretch.start() : 3 * stretch.end()]
        if stretch["whole"]:
            runs.append(SampleRun(decode_counts(part), lost))
            lost = 0
        elif stretch["tail"]:
            tail = part
        else:
            lost += 1
    return ([*runs, SampleRun(decode_counts(b""), lost)] if lost else runs), tail


def decode_counts(entries: bytes) -> NDArray[np.int32]:
    """Return the counts of complete samples, shape (n, 3), from 9 n bytes."""
    words = np.zeros((len(entries) // ENTRY_BYTES, 4), dtype=np.uint8)
    words[:, :3] = np.frombuffer(entries, dtype=np.uint8).reshape(-1, ENTRY_BYTES)
    counts: NDArray[np.int32] = words.view(">i4").astype(np.int32).reshape(-1, 3) >> 12
    return counts


class Adxl355(AccelerometerChip):
    """An ADXL355, or an ADXL357, which has the same registers and the same identity."""

    def __init__(self, kind: ChipKind, rate_hz: float, range_g: int) -> None:
        variant = ADXL355 if kind is ADXL355_KIND else ADXL357
        self.kind = kind
        self.info = DeviceInfo(
            kind=kind.kind,
            device_id=kind.kind,
            unit="counts",
            odr_hz=rate_hz,
            units_per_g=variant.units_per_g[range_g],
            full_scale_g=float(range_g),
            noise_g=noise_g(rate_hz, variant.noise_g_per_root_hz),
            zero_g_offset_g=variant.zero_g_offset_g,
            zero_g_offset_g_per_k=variant.zero_g_offset_g_per_k,
            scale_factor_per_k=SCALE_FACTOR_PER_K,
            bandwidth_hz=rate_hz / 4,
        )
        self.saturation_counts = code_limits(20)
        self.longest_block = MAX_READ_SAMPLES
        self.self_test = variant.self_test
        self.configuration = (
            Setting(POWER_CTL, "POWER_CTL", STANDBY),
            Setting(RANGE, "RANGE", RANGE_HIGH_SPEED | kind.ranges_g.index(range_g) + 1),
            Setting(FILTER, "FILTER", RATE_CODES[rate_hz]),
            Setting(SELF_TEST, "SELF_TEST", 0),
            Setting(POWER_CTL, "POWER_CTL", MEASURE),
        )
        self._temperature_25_c = variant.temperature_25_c
        self._tail = b""  # entries of an incomplete sample

    def revision(self, part: I2cPart, identity: Identity) -> str:
        """Return the revision."""
        return f"{part.read(REVID, 1)[0]:02x}"

    def reset(self, part: I2cPart, clock: Clock) -> None:
        """Reset the part, and wait until its memory is loaded. Raises `TransferError`."""
        part.write(RESET, RESET_CODE)
        deadline_ns = clock.now_ns() + RESET_NS
        while clock.now_ns() < deadline_ns:
            clock.sleep_s(RESET_POLL_S)
            with suppress(TransferError):  # it may not answer while it is busy
                if not part.read(STATUS, 1)[0] & NVM_BUSY:
                    return
        raise TransferError(f"{part}: still busy {RESET_NS / 1e9:g} s after reset; power-cycle the sensor")

    def fifo_level(self, part: I2cPart, clock: Clock) -> FifoLevel:
        """Return the level of the FIFO in axis entries. Reading the status clears the overrun bit."""
        status, entries = part.read(STATUS, 2)
        read_ns = clock.now_ns()
        if status & (NVM_BUSY | STATUS_UNUSED) or entries > FIFO_ENTRIES + ENTRIES_MARGIN:
            raise ImplausibleStatusError
        if status & OVERRUN:
            return FifoLevel(entries // 3, entries, read_ns, lost_at_least=1)
        return FifoLevel((len(self._tail) // ENTRY_BYTES + entries) // 3, entries, read_ns)

    def read_fifo(self, part: I2cPart, size: int) -> list[SampleRun]:
        """Read axis entries; an incomplete last sample is kept for the next call."""
        burst = part.read(FIFO_DATA, ENTRY_BYTES * size, consuming=True)
        runs, self._tail = split_entries(self._tail + burst)
        return runs

    def forget_partial(self) -> None:
        """Discard the entries of an incomplete sample."""
        self._tail = b""

    def temperature_c(self, part: I2cPart) -> float | None:
        """Return the temperature; None if its bytes, which are not latched, change in every reading."""
        for _ in range(TEMPERATURE_READS):
            high, low = part.read(TEMP2, 2)
            if part.read(TEMP2, 1)[0] == high:  # so the two bytes belong together
                return temperature_c((high & 0x0F) << 8 | low, self._temperature_25_c)
        return None
