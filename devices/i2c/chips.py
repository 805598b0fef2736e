"""The accelerometer chips by the kind that a configuration names."""

from collections.abc import Callable

from devices.i2c.accelerometer_chip import AccelerometerChip
from devices.i2c.adxl345 import Adxl345
from devices.i2c.adxl355 import ADXL357, Adxl355
from devices.i2c.lis2dw12 import Lis2dw12
from devices.i2c.lis3dh import Lis3dh
from devices.i2c.mpu9250 import MPU6050, Mpu9250

CHIPS: dict[str, Callable[[float, float], AccelerometerChip]] = {
    "adxl345": Adxl345,
    "adxl355": Adxl355,
    "adxl357": lambda odr_hz, range_g: Adxl355(odr_hz, range_g, ADXL357),
    "lis2dw12": Lis2dw12,
    "lis3dh": Lis3dh,
    "mpu6050": lambda odr_hz, range_g: Mpu9250(odr_hz, range_g, MPU6050),
    "mpu9250": Mpu9250,
}
"""Each takes the output data rate in Hz and the range in g, and raises `ValueError` for one that the chip does not have."""
