"""Register addresses and bits of the drivers against a second source: the drivers of the Linux kernel and of the makers.

Each row was read there, not in a data sheet and not in our driver: adxl355_core.c, adxl345_core.c, st_accel_core.c,
inv_mpu_iio.h and ti-ads1015.c of Linux; lis2dw12_reg.h of STMicroelectronics; Adafruit's ADXL345 library for the FIFO.
"""

from types import ModuleType

import pytest

from devices.i2c import ads1115, adxl345, adxl355, lis2dw12, lis3dh, mpu9250
from devices.i2c.chips import IDENTITIES

CONSTANTS: list[tuple[ModuleType, dict[str, int]]] = [
    (
        adxl355,
        {
            "STATUS": 0x04,
            "TEMP2": 0x06,
            "FIFO_DATA": 0x11,
            "FILTER": 0x28,
            "RANGE": 0x2C,
            "POWER_CTL": 0x2D,
            "SELF_TEST": 0x2E,
            "RESET": 0x2F,
            "RESET_CODE": 0x52,
            "STANDBY": 0x01,
            "MEASURE": 0x00,
        },
    ),
    (
        adxl345,
        {
            "OFSX": 0x1E,
            "BW_RATE": 0x2C,
            "POWER_CTL": 0x2D,
            "INT_SOURCE": 0x30,
            "DATA_FORMAT": 0x31,
            "DATAX0": 0x32,
            "FIFO_CTL": 0x38,
            "FIFO_STATUS": 0x39,
            "MEASURE": 0x08,
            "FULL_RES": 0x08,
        },
    ),
    (lis3dh, {"CTRL_REG1": 0x20, "CTRL_REG4": 0x23, "OUT_X_L": 0x28, "BLOCK_DATA_UPDATE": 0x80}),
    (
        lis2dw12,
        {
            "OUT_T_L": 0x0D,
            "CTRL1": 0x20,
            "CTRL2": 0x21,
            "CTRL3": 0x22,
            "CTRL6": 0x25,
            "OUT_X_L": 0x28,
            "FIFO_CTRL": 0x2E,
            "FIFO_SAMPLES": 0x2F,
            "HIGH_PERFORMANCE": 0x04,
            "SOFT_RESET": 0x40,
            "BLOCK_DATA_UPDATE": 0x08,
            "AUTO_INCREMENT": 0x04,
            "LOW_NOISE": 0x04,
            "CONTINUOUS": 6 << 5,
            "OVERRUN": 0x40,
            "UNREAD": 0x3F,
            "SELF_TEST_FORCE": 1 << 6,
        },
    ),
    (
        mpu9250,
        {
            "SMPLRT_DIV": 0x19,
            "CONFIG": 0x1A,
            "GYRO_CONFIG": 0x1B,
            "ACCEL_CONFIG": 0x1C,
            "ACCEL_CONFIG_2": 0x1D,
            "FIFO_EN": 0x23,
            "INT_ENABLE": 0x38,
            "INT_STATUS": 0x3A,
            "TEMP_OUT_H": 0x41,
            "USER_CTRL": 0x6A,
            "PWR_MGMT_1": 0x6B,
            "PWR_MGMT_2": 0x6C,
            "FIFO_COUNTH": 0x72,
            "FIFO_R_W": 0x74,
            "DEVICE_RESET": 0x80,
            "ALL_TO_FIFO": 0x80 | 0x70 | 0x08,
            "FIFO_RESET": 0x04,
            "FIFO_ENABLED": 0x40,
            "FIFO_OVERFLOW": 0x10,
        },
    ),
    (ads1115, {"SINGLE_ENDED": 0x4000, "START": 0x8000, "RANGE_4_096_V": 0x0200, "SINGLE_SHOT": 0x0100}),
]
IDENTITY_BYTES = {
    "ADXL355": (0x00, "ad1ded"),
    "ADXL359": (0x00, "ad1de9"),
    "ADXL345": (0x00, "e5"),
    "LIS3DH": (0x0F, "33"),
    "LIS2DW12": (0x0F, "44"),
    "MPU-6050": (0x75, "68"),
    "MPU-6500": (0x75, "70"),
    "MPU-9250": (0x75, "71"),
    "MPU-9255": (0x75, "73"),
}


@pytest.mark.parametrize(("driver", "constants"), CONSTANTS, ids=lambda each: getattr(each, "__name__", ""))
def test_registers_are_those_of_a_second_source(driver: ModuleType, constants: dict[str, int]) -> None:
    assert {name: getattr(driver, name) for name in constants} == constants


@pytest.mark.parametrize("name", IDENTITY_BYTES)
def test_identities_are_those_of_a_second_source(name: str) -> None:
    identity = IDENTITIES[name]
    assert (identity.register, identity.value.hex()) == IDENTITY_BYTES[name]


def test_rate_codes_are_those_of_a_second_source() -> None:
    assert lis3dh.RATE_CODES.items() >= {1.0: 1, 10.0: 2, 25.0: 3, 50.0: 4, 100.0: 5, 200.0: 6, 400.0: 7}.items()
    assert lis2dw12.RATE_CODES == {12.5: 2, 25.0: 3, 50.0: 4, 100.0: 5, 200.0: 6, 400.0: 7, 800.0: 8, 1600.0: 9}
    assert {4000.0 / 2**code: code for code in range(11)} == adxl355.RATE_CODES
    assert {0.09765625 * 2**code: code for code in range(6, 14)} == adxl345.RATE_CODES


def test_scales_and_temperatures_are_those_of_a_second_source() -> None:
    assert {r: 1e6 / u for r, u in lis3dh.UNITS_PER_G.items()} == pytest.approx({2: 1000, 4: 2000, 8: 4000, 16: 12000})
    assert {r: 1e6 / u for r, u in lis2dw12.UNITS_PER_G.items()} == pytest.approx(
        {2: 244, 4: 488, 8: 976, 16: 1952}, rel=1e-3
    )
    assert 9.80665 / adxl355.ADXL355.units_per_g[2] == pytest.approx(38245e-9, rel=2e-3)  # rounded there
    assert pytest.approx(0.0383, rel=1e-3) == 9.80665 / adxl345.UNITS_PER_G
    assert (adxl355.ADXL355.temperature_25_c, adxl355.ADXL357.temperature_25_c) == (1885, 1852)
    for variant, offset, scale in ((mpu9250.MPU9250, 7011, 2.995178e-3), (mpu9250.MPU6050, 12420, 2.941176e-3)):
        assert 1 / variant.temperature_units_per_k == pytest.approx(scale, rel=1e-4)
        assert variant.temperature_zero_c == pytest.approx(offset * scale, abs=0.01)
    assert pytest.approx(133090e-9, rel=1e-3) == mpu9250.RAD_S_PER_UNIT


def test_self_test_limits_of_the_lis2dw12_are_those_of_a_second_source() -> None:
    low, high = (counts * 244e-6 for counts in (285, 6150))  # of the maker's kernel driver, in digits at 2 g
    assert lis2dw12.SELF_TEST_LIMITS_G[0] == pytest.approx((low, high), rel=0.01)
