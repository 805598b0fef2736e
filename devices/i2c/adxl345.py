"""Analog Devices ADXL345: 13-bit triaxial MEMS accelerometer, its registers and decoding.

Registers and tables by the data sheet Rev. G, sections "Register map", "Register definitions" and "FIFO", and Table 1.
Registers and scale agree with Linux, adxl345_core.c, those of the FIFO with Adafruit's library. Not confirmed by a second source:
the limits of the self-test (a warning only), noise, zero-g offset and temperature coefficients.
"""

import math

from devices.block import DeviceInfo
from devices.clock import Clock
from devices.i2c.accelerometer_chip import (
    SAMPLE_BYTES,
    AccelerometerChip,
    FifoLevel,
    ImplausibleStatusError,
    SampleRun,
    SelfTest,
    Setting,
    decode_samples,
)
from devices.i2c.bus import I2cPart
from devices.i2c.chips import ADXL345_KIND, ChipKind
from devices.saturation import code_limits

OFSX = 0x1E
BW_RATE, POWER_CTL, INT_SOURCE, DATA_FORMAT = 0x2C, 0x2D, 0x30, 0x31
DATAX0, FIFO_CTL, FIFO_STATUS = 0x32, 0x38, 0x39
STANDBY, MEASURE = 0x00, 0x08
FULL_RES = 0x08
"""256 LSB/g at every range; the range then limits the number of bits."""
BYPASS, STREAM = 0x00, 0x80
OVERRUN = 0x01
ENTRIES, UNUSED = 0x3F, 0x40
FIFO_SAMPLES = 32
"""Data sheet, section "FIFO"."""

SELF_TEST_FORCE = 0x80
SELF_TEST_LIMITS_G = ((0.2, 4.43), (-4.43, -0.2), (0.3, 5.75))
"""Bits and limits of DATA_FORMAT. At 2.5 V the limits are 0.2 to 2.1 g, and 0.3 to 3.4 g along z; at 3.6 V the upper ones are
2.11 times, along z 1.69 times as large (Tables 1 and 14). Basis: data sheet."""

RATE_CODES = {rate_hz: 0xD - place for place, rate_hz in enumerate(ADXL345_KIND.rates_hz)}
"""Definition: codes of BW_RATE (data sheet)."""
UNITS_PER_G = 256.0
"""Scale in full resolution, at any range (data sheet, Table 1)."""
NOISE_LSB = 1.1
"""At 100 Hz, of the z axis, the noisiest. Basis: data sheet, Table 1."""
ZERO_G_OFFSET_G, ZERO_G_OFFSET_G_PER_K, SCALE_FACTOR_PER_K = 0.25, 1.2e-3, 1e-4
"""Limits of the z axis, which has the wider ones. Basis: data sheet, Table 1."""


class Adxl345(AccelerometerChip):
    """An ADXL345. It has neither a reset nor a temperature sensor, so every register that matters is written."""

    def __init__(self, kind: ChipKind, rate_hz: float, range_g: int) -> None:
        range_code = kind.ranges_g.index(range_g)
        self.kind = kind
        self.info = DeviceInfo(
            kind=kind.kind,
            device_id=kind.kind,
            unit="counts",
            odr_hz=rate_hz,
            units_per_g=UNITS_PER_G,
            full_scale_g=float(range_g),
            noise_g=NOISE_LSB / UNITS_PER_G * math.sqrt(rate_hz / 100),
            zero_g_offset_g=ZERO_G_OFFSET_G,
            zero_g_offset_g_per_k=ZERO_G_OFFSET_G_PER_K,
            scale_factor_per_k=SCALE_FACTOR_PER_K,
            bandwidth_hz=None,  # half of the rate
        )
        self.saturation_counts = code_limits(10 + range_code)
        self.longest_block = FIFO_SAMPLES // 2
        self.self_test = SelfTest(
            DATA_FORMAT,
            SELF_TEST_FORCE,
            lambda _: SELF_TEST_LIMITS_G,
            odr_hz=100.0,
            range_g=16,
            confirmed=False,
        )
        self.configuration = (
            Setting(POWER_CTL, "POWER_CTL", STANDBY),
            *(Setting(OFSX + axis, f"OFS{'XYZ'[axis]}", 0) for axis in range(3)),
            Setting(BW_RATE, "BW_RATE", RATE_CODES[rate_hz]),
            Setting(DATA_FORMAT, "DATA_FORMAT", FULL_RES | range_code),
            Setting(FIFO_CTL, "FIFO_CTL", BYPASS),  # empties the FIFO
            Setting(FIFO_CTL, "FIFO_CTL", STREAM),
            Setting(POWER_CTL, "POWER_CTL", MEASURE),
        )

    def fifo_level(self, part: I2cPart, clock: Clock) -> FifoLevel:
        """Return the number of samples. The overrun bit is cleared when samples are read.

        An empty FIFO can be read, too. The smaller of two readings protects against one that is too high.
        """
        first, read_ns = part.read(FIFO_STATUS, 1)[0], clock.now_ns()
        second = part.read(FIFO_STATUS, 1)[0]
        overrun = part.read(INT_SOURCE, 1)[0] & OVERRUN
        samples = min(first & ENTRIES, second & ENTRIES)
        if (first | second) & UNUSED or samples > FIFO_SAMPLES:
            raise ImplausibleStatusError
        if overrun:
            return FifoLevel(samples, samples, read_ns, lost_at_least=1)
        # A full FIFO may overrun between this reading and the first sample; then the bit is cleared unseen.
        return FifoLevel(samples, samples, read_ns, lost_at_least=0 if samples == FIFO_SAMPLES else None)

    def read_fifo(self, part: I2cPart, size: int) -> list[SampleRun]:
        """Read samples one by one: a longer burst does not advance the FIFO (section "FIFO", "Retrieving data").

        They are separate transfers, because the I2C controller of a Pi allows one read in each.
        """
        return decode_samples(b"".join(part.read(DATAX0, SAMPLE_BYTES, consuming=True) for _ in range(size)))
