"""A sysfs tree of one IIO device and a named pipe in the place of its character device, as the kernel's ABI describes them.

Knows nothing of any driver of ours. Documentation/ABI/testing/sysfs-bus-iio; adxl355_core.c and inv_mpu_core.c for the types.
"""

import os
from pathlib import Path

ADXL355 = {
    "scan_elements/in_accel_x_index": "0",
    "scan_elements/in_accel_y_index": "1",
    "scan_elements/in_accel_z_index": "2",
    "scan_elements/in_temp_index": "3",
    "scan_elements/in_timestamp_index": "4",
    **{f"scan_elements/in_accel_{axis}_type": "be:s20/32>>4" for axis in "xyz"},
    "scan_elements/in_temp_type": "be:s12/16>>0",
    "scan_elements/in_timestamp_type": "le:s64/64>>0",
    **{f"scan_elements/in_{name}_en": "0" for name in ("accel_x", "accel_y", "accel_z", "temp", "timestamp")},
    "name": "adxl355",
    "in_accel_scale": "0.000038245",
    "sampling_frequency": "4000.000000",
    "sampling_frequency_available": "4000.000000 2000.000000 1000.000000 500.000000 250.000000 125.000000",
    "in_temp_raw": "1795",
    "in_temp_offset": "-2111.250000",
    "in_temp_scale": "-110.497238",
    "current_timestamp_clock": "realtime",
    "buffer/enable": "0",
    "buffer/length": "2",
    "buffer/watermark": "1",
}
MPU6050 = {
    **{f"scan_elements/in_accel_{axis}_index": f"{index}" for index, axis in enumerate("xyz")},
    **{f"scan_elements/in_anglvel_{axis}_index": f"{index + 4}" for index, axis in enumerate("xyz")},
    "scan_elements/in_timestamp_index": "7",
    **{f"scan_elements/in_{kind}_{axis}_type": "be:s16/16>>0" for axis in "xyz" for kind in ("accel", "anglvel")},
    "scan_elements/in_timestamp_type": "le:s64/64>>0",
    **{f"scan_elements/in_{kind}_{axis}_en": "0" for axis in "xyz" for kind in ("accel", "anglvel")},
    "scan_elements/in_timestamp_en": "0",
    "name": "mpu6050",
    "in_accel_scale": "0.000598",
    "in_accel_scale_available": "0.000598 0.001196 0.002392 0.004785",
    "in_anglvel_scale": "0.000133090",
    "sampling_frequency": "100",
    "current_timestamp_clock": "realtime",
    "buffer/enable": "0",
    "buffer/length": "2",
    "buffer/watermark": "1",
}


class IioTree:
    def __init__(self, root: Path, attributes: dict[str, str] = ADXL355, number: int = 0, label: str = "") -> None:
        self.root = root
        self.folder = root / f"sys/bus/iio/devices/iio:device{number}"
        self.pipe = root / f"dev/iio:device{number}"
        for name, text in {**attributes, **({"label": label} if label else {})}.items():
            self.set(name, text)
        self.pipe.parent.mkdir(parents=True, exist_ok=True)
        os.mkfifo(self.pipe)
        self._end = os.open(self.pipe, os.O_RDWR | os.O_NONBLOCK)

    def set(self, name: str, text: str) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")

    def get(self, name: str) -> str:
        return (self.folder / name).read_text().strip()

    def send(self, data: bytes) -> None:
        os.write(self._end, data)

    def vanish(self) -> None:
        """The sensor is unbound: its folder goes, and its character device ends."""
        for path in sorted(self.folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        self.folder.rmdir()
        self.pipe.unlink()
        self.close()

    def close(self) -> None:
        if self._end >= 0:
            os.close(self._end)
            self._end = -1


def adxl355_scan(x: int, y: int, z: int, time_ns: int) -> bytes:
    """x, y, z of 20 bits, each left-justified in three bytes behind an unused one; padding; timestamp."""
    words = b"".join(b"\x5a" + (value << 4 & 0xFFFFFF | 0xF).to_bytes(3, "big") for value in (x, y, z))
    return words + bytes(4) + time_ns.to_bytes(8, "little", signed=True)


def mpu6050_scan(force: tuple[int, int, int], rate: tuple[int, int, int], time_ns: int) -> bytes:
    words = b"".join(value.to_bytes(2, "big", signed=True) for value in (*force, *rate))
    return words + bytes(4) + time_ns.to_bytes(8, "little", signed=True)
