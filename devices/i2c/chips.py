"""The kinds of accelerometer chips, which their modules declare. Configuration, search and self-test follow from this table."""

from devices.i2c.accelerometer_chip import ChipKind
from devices.i2c.adxl345 import ADXL345_KIND
from devices.i2c.adxl355 import ADXL355_KIND, ADXL357_KIND
from devices.i2c.lis2dw12 import LIS2DW12_KIND
from devices.i2c.lis3dh import LIS3DH_KIND
from devices.i2c.mpu9250 import MPU6050_KIND, MPU9250_KIND

CHIPS: dict[str, ChipKind] = {
    chip.kind: chip
    for chip in (
        ADXL355_KIND,
        ADXL357_KIND,
        ADXL345_KIND,
        LIS3DH_KIND,
        LIS2DW12_KIND,
        MPU9250_KIND,
        MPU6050_KIND,
    )
}
"""By the kind that a configuration names."""
