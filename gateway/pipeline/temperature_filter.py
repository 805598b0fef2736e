"""The temperature of a sensor as the thermal model uses it: without the noise and the steps of its thermometer."""

import math

TIME_CONSTANT_S = 30.0
"""Time constant of the filter, s. Basis: a housing warms up within many minutes, a thermometer steps by 0.1 °C from block to
block."""


class TemperatureFilter:
    """A low-pass filter of first order for temperatures at irregular times."""

    def __init__(self) -> None:
        self._filtered_c = math.nan
        self._time_ns = 0

    def update(self, time_ns: int, temperature_c: float | None) -> float:
        """Return the filtered temperature, °C, after a temperature or, for None, without a new one; NaN before the first."""
        if temperature_c is None:
            return self._filtered_c
        if math.isnan(self._filtered_c):
            self._filtered_c = temperature_c
        else:
            share = -math.expm1(-max(time_ns - self._time_ns, 0) / (TIME_CONSTANT_S * 1e9))
            self._filtered_c += share * (temperature_c - self._filtered_c)
        self._time_ns = time_ns
        return self._filtered_c
