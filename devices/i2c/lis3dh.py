"""STMicroelectronics LIS3DH: 12-bit triaxial MEMS accelerometer, its registers and decoding.

Registers and tables by the data sheet DocID17530 Rev. 2, sections 2 (Tables 4, 10 to 12), 5.1 (FIFO) and 8 (registers). A
register address with `AUTO_INCREMENT` is followed by the next ones in a burst (section 6.1.1).
Identity, rates, ranges and scales agree with Linux, st_accel_core.c, the self-test with the maker's examples. Not confirmed by a
second source: the rate of 1344 Hz, noise, zero-g offset and temperature coefficients.
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
from devices.i2c.chips import LIS3DH_KIND, ChipKind
from devices.saturation import code_limits

AUTO_INCREMENT = 0x80
CTRL_REG1, CTRL_REG2, CTRL_REG4, CTRL_REG5 = 0x20, 0x21, 0x23, 0x24
OUT_X_L, FIFO_CTRL_REG, FIFO_SRC_REG = 0x28, 0x2E, 0x2F
POWER_DOWN, AXES_ENABLED = 0x00, 0x07
BLOCK_DATA_UPDATE, HIGH_RESOLUTION = 0x80, 0x08
BOOT, FIFO_ENABLED = 0x80, 0x40
BYPASS, STREAM = 0x00, 0x80
OVERRUN, EMPTY, UNREAD = 0x40, 0x20, 0x1F
FIFO_SAMPLES = 32
"""Data sheet, section 5.1."""
UNUSED_BITS = 4
"""Definition: 12 bits are left-justified in 16."""
BOOT_S = 0.005
"""Time for which the part boots (data sheet)."""

SELF_TEST_FORCE = 0x02
SELF_TEST_LIMITS_G = ((0.068, 1.44),) * 3
"""Bits and limits of CTRL_REG4, at 50 Hz and 2 g. 17 to 360 digits of 4 mg (Table 4). Basis: data sheet."""

RATE_CODES = dict(zip(LIS3DH_KIND.rates_hz, (9, 7, 6, 5, 4, 3, 2, 1), strict=True))
"""Table 31, in high-resolution mode."""
UNITS_PER_G = {2: 1000.0, 4: 500.0, 8: 250.0, 16: 1000.0 / 12}
"""Table 4: 1, 2, 4 and 12 mg per digit in high-resolution mode."""
SATURATION_COUNTS = dict.fromkeys((2, 4, 8), code_limits(12)) | {16: (-1333, 1333)}
"""At 16 g twelve bits reach 24.6 g, but the data sheet promises no more than 16 g."""
NOISE_G_PER_ROOT_HZ = 220e-6
"""Data sheet, Table 4."""
ZERO_G_OFFSET_G, ZERO_G_OFFSET_G_PER_K, SCALE_FACTOR_PER_K = 0.04, 0.5e-3, 1e-4
"""Data sheet, Table 4."""


class Lis3dh(AccelerometerChip):
    """A LIS3DH in high-resolution mode. Its temperature sensor has no absolute zero (section 3.7), so none is delivered."""

    def __init__(self, kind: ChipKind, rate_hz: float, range_g: int) -> None:
        bandwidth_hz = rate_hz / 9  # Table 12
        self.kind = kind
        self.info = DeviceInfo(
            kind=kind.kind,
            device_id=kind.kind,
            unit="counts",
            odr_hz=rate_hz,
            units_per_g=UNITS_PER_G[range_g],
            full_scale_g=float(range_g),
            noise_g=NOISE_G_PER_ROOT_HZ * math.sqrt(math.pi / 2 * bandwidth_hz),
            zero_g_offset_g=ZERO_G_OFFSET_G,
            zero_g_offset_g_per_k=ZERO_G_OFFSET_G_PER_K,
            scale_factor_per_k=SCALE_FACTOR_PER_K,
            bandwidth_hz=bandwidth_hz,
        )
        self.saturation_counts = SATURATION_COUNTS[range_g]
        self.longest_block = FIFO_SAMPLES // 2
        self.self_test = SelfTest(
            CTRL_REG4, SELF_TEST_FORCE, lambda _: SELF_TEST_LIMITS_G, odr_hz=50.0, range_g=2, either_sign=True
        )
        self.configuration = (
            Setting(CTRL_REG1, "CTRL_REG1", POWER_DOWN),
            Setting(CTRL_REG2, "CTRL_REG2", 0),  # no high-pass filter
            Setting(CTRL_REG4, "CTRL_REG4", BLOCK_DATA_UPDATE | kind.ranges_g.index(range_g) << 4 | HIGH_RESOLUTION),
            Setting(CTRL_REG5, "CTRL_REG5", FIFO_ENABLED),
            Setting(FIFO_CTRL_REG, "FIFO_CTRL_REG", BYPASS),  # empties the FIFO
            Setting(FIFO_CTRL_REG, "FIFO_CTRL_REG", STREAM),
            Setting(CTRL_REG1, "CTRL_REG1", RATE_CODES[rate_hz] << 4 | AXES_ENABLED),
        )

    def reset(self, part: I2cPart, clock: Clock) -> None:
        """Load the factory trimming again. The control registers keep their values; all that matter are written."""
        part.write(CTRL_REG5, BOOT)
        clock.sleep_s(BOOT_S)

    def fifo_level(self, part: I2cPart, clock: Clock) -> FifoLevel:
        """Return the number of samples.

        An empty FIFO can be read, too. The smaller of two readings protects against one that is too high. With the overrun bit
        the FIFO is full; the number that it has overwritten, maybe none, follows from the sample times.
        """
        first, read_ns = part.read(FIFO_SRC_REG, 1)[0], clock.now_ns()
        second = part.read(FIFO_SRC_REG, 1)[0]
        if any(status & EMPTY and status & (UNREAD | OVERRUN) for status in (first, second)):
            raise ImplausibleStatusError
        if first & second & OVERRUN:
            return FifoLevel(FIFO_SAMPLES, FIFO_SAMPLES, read_ns, lost_at_least=0)
        samples = min(first & UNREAD, second & UNREAD)
        return FifoLevel(samples, samples, read_ns)

    def read_fifo(self, part: I2cPart, size: int) -> list[SampleRun]:
        """Read samples in one burst: after OUT_Z_H the address returns to OUT_X_L (section 5.1.5)."""
        data = part.read(OUT_X_L | AUTO_INCREMENT, SAMPLE_BYTES * size, consuming=True)
        return decode_samples(data, UNUSED_BITS)
