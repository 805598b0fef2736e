"""InvenSense MPU-9250, MPU-9255, MPU-6500 and MPU-6050: accelerometers with gyroscope, their registers and decoding.

Registers and tables by the register maps RM-MPU-9250A-00 Rev. 1.6 and RM-MPU-6000A-00 Rev. 4.2, section 4, and the product
specifications PS-MPU-9250A-01 Rev. 1.1 and PS-MPU-6000A-00 Rev. 3.4, Tables 1 and 2. Registers, bits, order in the FIFO, scales
and temperature agree with Linux, inv_mpu6050. Not confirmed by a second source: noise, bias of the gyroscope, zero-g offset and
temperature coefficients, and the size of the MPU-6500's FIFO.
"""

import math
from dataclasses import dataclass

import numpy as np

from devices.block import DeviceInfo
from devices.clock import Clock
from devices.i2c.accelerometer_chip import (
    AccelerometerChip,
    AxisLimits,
    FifoLevel,
    ImplausibleStatusError,
    LostAlignmentError,
    SampleRun,
    SelfTest,
    Setting,
)
from devices.i2c.bus import I2cPart
from devices.i2c.chips import MPU9250_KIND, ChipKind, Identity
from devices.saturation import code_limits

SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG_2, FIFO_EN = 0x19, 0x1A, 0x1B, 0x1C, 0x1D, 0x23
INT_ENABLE, INT_STATUS, TEMP_OUT_H = 0x38, 0x3A, 0x41
USER_CTRL, PWR_MGMT_1, PWR_MGMT_2, FIFO_COUNTH, FIFO_R_W = 0x6A, 0x6B, 0x6C, 0x72, 0x74
DEVICE_RESET, BEST_CLOCK = 0x80, 0x01
RESET_S = 0.1
"""Pause after a reset. Basis: the start-up time of the product specifications, at most 0.1 s."""
ALL_TO_FIFO = 0xF8
"""Temperature, three rates and the accelerometer, in the order of their output registers: acceleration, temperature, rates."""
FIFO_RESET, FIFO_ENABLED = 0x04, 0x40
FIFO_OVERFLOW = 0x10
SAMPLE_BYTES = 14
"""Definition: three axes of force, temperature and three rates of 16 bits."""

UNITS_PER_G_2 = 16384.0
"""At a range of 2 g. Definition: 16 bits over the range."""
RAD_S_PER_UNIT = math.radians(250.0) / 32768
"""At the smallest range of the gyroscope, 250 deg/s. Definition: 16 bits over the range."""
TEMPERATURE_SLIP = 512
"""A larger difference (1.5 K) between a temperature in the FIFO and the last one means bytes that are out of step. Basis: a
choice; a housing warms by less within a block, and other bytes seldom agree so well."""


SELF_TEST_FORCE = 0xE0
SELF_TEST_X_ACCEL = 0x0D
SELF_TEST_WITHOUT_TRIM_G = (0.225, 0.675)
"""Basis: half and one and a half times a response of 0.45 g, for a part without a trim."""


def self_test_limits_g(part: I2cPart) -> AxisLimits:
    """Return half and one and a half times the response at the factory, 2620 x 1.01^(code - 1) at a range of 2 g.

    A code of 0 means that none was stored. Source: section 4.1 of the register map and AN-MPU-9250A-03.
    """
    x, y, z = (_limits_by_code(code) for code in part.read(SELF_TEST_X_ACCEL, 3))
    return x, y, z


def _limits_by_code(code: int) -> tuple[float, float]:
    if not code:
        return SELF_TEST_WITHOUT_TRIM_G
    factory_g = 2620.0 * 1.01 ** (code - 1) / UNITS_PER_G_2
    return 0.5 * factory_g, 1.5 * factory_g


@dataclass(frozen=True, slots=True)
class MpuVariant:
    """The figures in which the generations differ."""

    fifo_bytes: int
    has_accel_config_2: bool
    bandwidths_hz: tuple[float, ...]
    """Bandwidths of the accelerometer, by the codes 1 to 6 of its low-pass filter."""
    gyro_bandwidths_hz: tuple[float, ...]
    """Bandwidths of the gyroscope, by the same codes."""
    gyro_noise_rad_s_per_root_hz: float
    gyro_bias_rad_s: float
    noise_g_per_root_hz: float
    zero_g_offset_g: float
    zero_g_offset_g_per_k: float
    scale_factor_per_k: float
    temperature_units_per_k: float
    temperature_zero_c: float


MPU9250 = MpuVariant(
    fifo_bytes=512,
    has_accel_config_2=True,
    bandwidths_hz=(218.1, 99.0, 44.8, 21.2, 10.2, 5.05),
    gyro_bandwidths_hz=(184.0, 92.0, 41.0, 20.0, 10.0, 5.0),
    gyro_noise_rad_s_per_root_hz=math.radians(0.01),
    gyro_bias_rad_s=math.radians(5.0),
    noise_g_per_root_hz=300e-6,
    zero_g_offset_g=0.08,
    zero_g_offset_g_per_k=1.5e-3,
    scale_factor_per_k=2.6e-4,
    temperature_units_per_k=333.87,
    temperature_zero_c=21.0,
)
"""Data sheet PS-MPU-9250A-01, Tables 1 and 2."""
MPU6050 = MpuVariant(
    fifo_bytes=1024,
    has_accel_config_2=False,
    bandwidths_hz=(184.0, 94.0, 44.0, 21.0, 10.0, 5.0),
    gyro_bandwidths_hz=(188.0, 98.0, 42.0, 20.0, 10.0, 5.0),
    gyro_noise_rad_s_per_root_hz=math.radians(0.005),
    gyro_bias_rad_s=math.radians(20.0),
    noise_g_per_root_hz=400e-6,
    zero_g_offset_g=0.08,
    zero_g_offset_g_per_k=1.0e-3,  # over 0 to 70 °C: 60 mg of the z axis
    scale_factor_per_k=2e-4,
    temperature_units_per_k=340.0,
    temperature_zero_c=36.53,
)
"""Data sheet PS-MPU-6000A-00, Tables 1 and 2."""


class Mpu9250(AccelerometerChip):
    """An MPU-9250, MPU-9255, MPU-6500 or MPU-6050."""

    def __init__(self, kind: ChipKind, rate_hz: float, range_g: int) -> None:
        variant = MPU9250 if kind is MPU9250_KIND else MPU6050
        filter_code, bandwidth_hz = _lowpass(variant, rate_hz)
        gyro_bandwidth_hz = variant.gyro_bandwidths_hz[filter_code - 1]
        self.kind = kind
        self.info = DeviceInfo(
            kind=kind.kind,
            device_id=kind.kind,
            unit="counts",
            odr_hz=rate_hz,
            units_per_g=UNITS_PER_G_2 / (range_g // 2),
            full_scale_g=float(range_g),
            noise_g=variant.noise_g_per_root_hz * math.sqrt(math.pi / 2 * bandwidth_hz),
            zero_g_offset_g=variant.zero_g_offset_g,
            zero_g_offset_g_per_k=variant.zero_g_offset_g_per_k,
            scale_factor_per_k=variant.scale_factor_per_k,
            bandwidth_hz=bandwidth_hz,
            gyro_rad_s_per_count=RAD_S_PER_UNIT,
            gyro_noise_rad_s=variant.gyro_noise_rad_s_per_root_hz * math.sqrt(math.pi / 2 * gyro_bandwidth_hz),
            gyro_bias_rad_s=variant.gyro_bias_rad_s,
        )
        self.saturation_counts = code_limits(16)
        self.longest_block = variant.fifo_bytes // SAMPLE_BYTES // 2
        second = (Setting(ACCEL_CONFIG_2, "ACCEL_CONFIG_2", filter_code),) if variant.has_accel_config_2 else ()
        has_test = variant.has_accel_config_2  # that of the MPU-6050 has another formula
        self.self_test = (
            SelfTest(ACCEL_CONFIG, SELF_TEST_FORCE, self_test_limits_g, odr_hz=200.0, range_g=2, either_sign=True)
            if has_test
            else None
        )
        self.configuration = (
            Setting(PWR_MGMT_1, "PWR_MGMT_1", BEST_CLOCK),
            Setting(PWR_MGMT_2, "PWR_MGMT_2", 0),
            Setting(SMPLRT_DIV, "SMPLRT_DIV", kind.rates_hz.index(rate_hz)),
            Setting(CONFIG, "CONFIG", filter_code),
            Setting(GYRO_CONFIG, "GYRO_CONFIG", 0),
            Setting(ACCEL_CONFIG, "ACCEL_CONFIG", kind.ranges_g.index(range_g) << 3),
            *second,
            Setting(INT_ENABLE, "INT_ENABLE", FIFO_OVERFLOW),
            Setting(FIFO_EN, "FIFO_EN", ALL_TO_FIFO),
            Setting(USER_CTRL, "USER_CTRL", FIFO_ENABLED),
        )
        self._variant = variant
        self._out_of_step = False
        self._temperature: int | None = None

    def revision(self, part: I2cPart, identity: Identity) -> str:
        """Return the identity, which differs between the members of the family."""
        return identity.value.hex()

    def reset(self, part: I2cPart, clock: Clock) -> None:
        """Restore the defaults."""
        part.write(PWR_MGMT_1, DEVICE_RESET)
        clock.sleep_s(RESET_S)

    def fifo_level(self, part: I2cPart, clock: Clock) -> FifoLevel:
        """Return the number of bytes; the smaller of two readings protects against one that is too high.

        After an overflow the bytes are out of step, so the FIFO is emptied at the next call.
        """
        if self._out_of_step:
            part.write(USER_CTRL, FIFO_ENABLED | FIFO_RESET)
            self._out_of_step = False
            return FifoLevel(0, 0, clock.now_ns())
        first, read_ns = part.read(FIFO_COUNTH, 2), clock.now_ns()
        second = part.read(FIFO_COUNTH, 2)
        overflow = part.read(INT_STATUS, 1)[0] & FIFO_OVERFLOW
        count = min(int.from_bytes(first, "big"), int.from_bytes(second, "big"))
        if count > self._variant.fifo_bytes:
            raise ImplausibleStatusError
        if overflow or count > self._variant.fifo_bytes - SAMPLE_BYTES:
            return FifoLevel(0, 0, read_ns, lost_at_least=1)
        samples = count // SAMPLE_BYTES
        return FifoLevel(samples, samples, read_ns)

    def read_fifo(self, part: I2cPart, size: int) -> list[SampleRun]:
        """Read samples in one burst. Their temperatures show whether the bytes are in step."""
        data = part.read(FIFO_R_W, SAMPLE_BYTES * size, consuming=True)
        words = np.frombuffer(data, dtype=">i2").reshape(-1, 7).astype(np.int32)
        known = int(np.median(words[:, 3])) if self._temperature is None else self._temperature
        if np.abs(words[:, 3] - known).max() > TEMPERATURE_SLIP:
            raise LostAlignmentError
        return [SampleRun(words[:, :3], gyro_counts=words[:, 4:])]

    def forget_partial(self) -> None:
        """Empty the FIFO before it is read again: an interrupted burst has left it out of step."""
        self._out_of_step = True

    def temperature_c(self, part: I2cPart) -> float | None:
        """Return the temperature."""
        self._temperature = int.from_bytes(part.read(TEMP_OUT_H, 2), "big", signed=True)
        return self._temperature / self._variant.temperature_units_per_k + self._variant.temperature_zero_c


def _lowpass(variant: MpuVariant, rate_hz: float) -> tuple[int, float]:
    """Return code and bandwidth of the widest low-pass filter below half of the rate, or of the narrowest one."""
    fitting = (pair for pair in enumerate(variant.bandwidths_hz, start=1) if pair[1] < rate_hz / 2)
    return next(fitting, (len(variant.bandwidths_hz), variant.bandwidths_hz[-1]))
