"""The check of the configured output data rate of a sensor on a serial port."""

from devices.errors import DeviceError

WINDOW_S = 10.0
TOLERANCE = 0.15
"""Larger than the deviation of a sensor's clock, smaller than the distance to the next rate that can be set."""


class RateCheck:
    """Counts samples: with a wrong `odr_hz` sample times would be plausible but wrong."""

    def __init__(self, odr_hz: float) -> None:
        self._odr_hz = odr_hz
        self._start_ns: int | None = None
        self._count = 0

    def restart(self) -> None:
        """Begin again after an interruption."""
        self._start_ns = None

    def add(self, count: int, read_ns: int) -> None:
        """Count samples, lost ones included, that were read at this gateway time. Raises `DeviceError` for a wrong rate."""
        if self._start_ns is None:
            self._start_ns, self._count = read_ns, 0
            return
        self._count += count
        elapsed_s = (read_ns - self._start_ns) / 1e9
        if elapsed_s < WINDOW_S:
            return
        rate_hz = self._count / elapsed_s
        self._start_ns, self._count = read_ns, 0
        if abs(rate_hz / self._odr_hz - 1) > TOLERANCE:
            came = f"{rate_hz:.1f} samples/s arrive, but odr_hz is {self._odr_hz:g}"
            raise DeviceError(f"{came}; set odr_hz to the sensor's rate, or bring the radio nearer")
