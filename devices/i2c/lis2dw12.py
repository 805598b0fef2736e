"""STMicroelectronics LIS2DW12: 14-bit triaxial MEMS accelerometer, its registers and decoding.

Registers and tables by the data sheet DS11811 Rev. 8, sections 2 (Tables 3 and 4), 5 (FIFO) and 8 (registers).
Registers, bits and scales agree with the maker's lis2dw12_reg.h, the limits of the self-test with the maker's kernel driver.
Not confirmed by a second source: noise, zero-g offset and temperature coefficients.
"""

import math

from devices.block import DeviceInfo
from devices.clock import Clock
from devices.errors import TransferError
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
from devices.i2c.chips import LIS2DW12_KIND, ChipKind
from devices.saturation import code_limits

OUT_T_L, CTRL1, CTRL2, CTRL3, CTRL6 = 0x0D, 0x20, 0x21, 0x22, 0x25
OUT_X_L, FIFO_CTRL, FIFO_SAMPLES = 0x28, 0x2E, 0x2F
POWER_DOWN, HIGH_PERFORMANCE = 0x00, 0x04
SOFT_RESET, BLOCK_DATA_UPDATE, AUTO_INCREMENT = 0x40, 0x08, 0x04
LOW_NOISE = 0x04
BYPASS, CONTINUOUS = 0x00, 0xC0
OVERRUN, UNREAD = 0x40, 0x3F
FIFO_SIZE = 32
"""Data sheet, section 5."""
UNUSED_BITS = 2
RESET_POLLS, RESET_POLL_S = 20, 0.005
"""Longest wait for a reset, in polls. Basis: a choice; a reset takes microseconds, and 0.1 s does not delay a start."""

SELF_TEST_FORCE = 0x40
SELF_TEST_LIMITS_G = ((0.07, 1.5),) * 3
"""Bits and limits of CTRL3, at 50 Hz and 4 g (Table 3). Basis: data sheet."""

RATE_CODES = {rate_hz: 9 - place for place, rate_hz in enumerate(LIS2DW12_KIND.rates_hz)}
"""Definition: codes of CTRL1 (data sheet, section 8.4)."""
UNITS_PER_G = {2: 4096.0, 4: 2048.0, 8: 1024.0, 16: 512.0}
"""14 bits over the range; Table 3 rounds them to 0.244, 0.488, 0.976 and 1.952 mg per digit."""
NOISE_G_PER_ROOT_HZ = 90e-6
"""Data sheet, Table 3."""
ZERO_G_OFFSET_G, ZERO_G_OFFSET_G_PER_K, SCALE_FACTOR_PER_K = 0.02, 0.2e-3, 1e-4
"""Data sheet, Table 3."""
UNITS_PER_KELVIN = 256.0
"""Scale of OUT_T: 12 bits, left-justified, 16 per kelvin, 0 at 25 °C (Table 5)."""


class Lis2dw12(AccelerometerChip):
    """A LIS2DW12 in high-performance mode with low noise."""

    def __init__(self, kind: ChipKind, rate_hz: float, range_g: int) -> None:
        self.kind = kind
        self.info = DeviceInfo(
            kind=kind.kind,
            device_id=kind.kind,
            unit="counts",
            odr_hz=rate_hz,
            units_per_g=UNITS_PER_G[range_g],
            full_scale_g=float(range_g),
            noise_g=NOISE_G_PER_ROOT_HZ * math.sqrt(rate_hz / 2),
            zero_g_offset_g=ZERO_G_OFFSET_G,
            zero_g_offset_g_per_k=ZERO_G_OFFSET_G_PER_K,
            scale_factor_per_k=SCALE_FACTOR_PER_K,
            bandwidth_hz=None,  # half of the rate
        )
        self.saturation_counts = code_limits(14)
        self.longest_block = FIFO_SIZE // 2
        self.self_test = SelfTest(
            CTRL3,
            SELF_TEST_FORCE,
            lambda _: SELF_TEST_LIMITS_G,
            odr_hz=50.0,
            range_g=4,
            either_sign=True,
        )
        self.configuration = (
            Setting(CTRL1, "CTRL1", POWER_DOWN),
            Setting(CTRL2, "CTRL2", BLOCK_DATA_UPDATE | AUTO_INCREMENT),
            Setting(CTRL3, "CTRL3", 0),
            Setting(CTRL6, "CTRL6", kind.ranges_g.index(range_g) << 4 | LOW_NOISE),
            Setting(FIFO_CTRL, "FIFO_CTRL", BYPASS),  # empties the FIFO
            Setting(FIFO_CTRL, "FIFO_CTRL", CONTINUOUS),
            Setting(CTRL1, "CTRL1", RATE_CODES[rate_hz] << 4 | HIGH_PERFORMANCE),
        )

    def reset(self, part: I2cPart, clock: Clock) -> None:
        """Reset the control registers; the bit clears itself. Raises `TransferError`."""
        part.write(CTRL2, SOFT_RESET)
        for _ in range(RESET_POLLS):
            clock.sleep_s(RESET_POLL_S)
            if not part.read(CTRL2, 1)[0] & SOFT_RESET:
                return
        raise TransferError(f"{part}: still busy {RESET_POLLS * RESET_POLL_S:g} s after reset; power-cycle the sensor")

    def fifo_level(self, part: I2cPart, clock: Clock) -> FifoLevel:
        """Return the number of samples.

        An empty FIFO can be read, too. The smaller of two readings protects against one that is too high.
        """
        first, read_ns = part.read(FIFO_SAMPLES, 1)[0], clock.now_ns()
        second = part.read(FIFO_SAMPLES, 1)[0]
        samples = min(first & UNREAD, second & UNREAD)
        if samples > FIFO_SIZE:
            raise ImplausibleStatusError
        return FifoLevel(samples, samples, read_ns, lost_at_least=1 if first & second & OVERRUN else None)

    def read_fifo(self, part: I2cPart, size: int) -> list[SampleRun]:
        """Read samples in one burst: after OUT_Z_H the address returns to OUT_X_L (section 5.3)."""
        return decode_samples(part.read(OUT_X_L, SAMPLE_BYTES * size, consuming=True), UNUSED_BITS)

    def temperature_c(self, part: I2cPart) -> float | None:
        """Return the temperature."""
        return 25.0 + int.from_bytes(part.read(OUT_T_L, 2), "little", signed=True) / UNITS_PER_KELVIN
