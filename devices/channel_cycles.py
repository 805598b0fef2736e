"""Channels that are read one after another, interpolated to common instants that are evenly spaced by the host's clock."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.clock import Clock


def interpolate_channels(
    times_ns: NDArray[np.int64], values: NDArray[np.float64], instants_ns: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the values of all channels at common instants, shape (n, channels), linearly between their own times.

    `times_ns` and `values`: shape (cycles, channels). Every instant must lie within the times of every channel.
    """
    start_ns = int(times_ns[0].min())  # as ns since 1970 a float is too coarse
    instants = (instants_ns - start_ns).astype(np.float64)
    channels = range(times_ns.shape[1])
    return np.column_stack([np.interp(instants, times_ns[:, c] - start_ns, values[:, c]) for c in channels])


@dataclass(frozen=True, slots=True)
class Instants:
    """All channels at consecutive instants."""

    time_ns: NDArray[np.int64]
    """Shape (n,)."""
    values: NDArray[np.float64]
    """Shape (n, channels)."""
    saturated: NDArray[np.bool_]
    """Instants that are interpolated from a saturated reading, shape (n,)."""
    lost: int
    """Instants missing before the first one, because there was a pause."""


class ChannelCycles:
    """Paces and collects cycles, each with one reading of every channel, and interpolates between them."""

    def __init__(self, odr_hz: float, clock: Clock) -> None:
        self._period_ns = round(1e9 / odr_hz)
        self._clock = clock
        self.restart()

    def restart(self) -> None:
        """Forget all cycles and instants; the first cycle begins now."""
        self._due_ns = self._clock.now_ns()
        self._times_ns: list[list[int]] = []
        self._values: list[list[float]] = []
        self._saturated: list[bool] = []
        self._next_ns: int | None = None
        self._last_ns: int | None = None

    def __len__(self) -> int:
        """Return the number of cycles that wait."""
        return len(self._times_ns)

    def await_next(self) -> int:
        """Wait until the next cycle begins, at a multiple of the period; return how many the host was too late for."""
        now_ns = self._clock.now_ns()
        late = max(0, (now_ns - self._due_ns) // self._period_ns)
        self._due_ns += late * self._period_ns
        self._clock.sleep_s((self._due_ns - now_ns) / 1e9)
        self._due_ns += self._period_ns
        return late

    def add(self, times_ns: list[int], values: list[float], *, is_saturated: bool) -> None:
        """Add a cycle: when each channel was read, and its reading."""
        self._times_ns.append(times_ns)
        self._values.append(values)
        self._saturated.append(is_saturated)

    def take(self) -> Instants | None:
        """Return the instants between the cycles so far, up to the first pause; None without one."""
        times_ns, values = np.array(self._times_ns, dtype=np.int64), np.array(self._values)
        saturated = np.array(self._saturated)
        if len(times_ns) < 2:
            return None
        pauses = np.flatnonzero(np.diff(times_ns[:, 0]) > 1.5 * self._period_ns)
        end = int(pauses[0]) + 1 if len(pauses) else len(times_ns)
        kept = end if len(pauses) else end - 2  # between these two the next instant lies
        self._times_ns, self._values = self._times_ns[kept:], self._values[kept:]
        self._saturated = self._saturated[kept:]
        first_ns, last_ns = int(times_ns[0].max()), int(times_ns[end - 1].min())
        next_ns = first_ns if self._next_ns is None or self._next_ns < first_ns else self._next_ns
        instants_ns = np.arange(next_ns, last_ns + 1, self._period_ns, dtype=np.int64)
        if not len(instants_ns):
            return None
        lost = 0 if self._last_ns is None else round((next_ns - self._last_ns) / self._period_ns) - 1
        self._last_ns = int(instants_ns[-1])
        self._next_ns = self._last_ns + self._period_ns
        return Instants(
            instants_ns,
            interpolate_channels(times_ns[:end], values[:end], instants_ns),
            _near_saturated(times_ns[:end], saturated[:end], instants_ns),
            lost,
        )


def _near_saturated(
    times_ns: NDArray[np.int64], saturated: NDArray[np.bool_], instants_ns: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return the instants, shape (n,), between a saturated cycle and its neighbours; `times_ns`: shape (cycles, channels)."""
    found = np.zeros(len(instants_ns), dtype=np.bool_)
    for cycle in np.flatnonzero(saturated).tolist():
        begin_ns, end_ns = times_ns[max(cycle - 1, 0)].min(), times_ns[min(cycle + 1, len(times_ns) - 1)].max()
        found |= (instants_ns >= begin_ns) & (instants_ns <= end_ns)
    return found
