"""The protocol of every source of samples: a sensor, a radio receiver, a recording, a simulation."""

from collections.abc import Mapping
from typing import Protocol

from devices.block import DeviceInfo, SampleBlock

MAX_READ_S = 0.5
"""Longest read of any device. Basis: a thread that reads ends within it (`JOIN_S`)."""
MAX_READ_NS = round(MAX_READ_S * 1e9)
MAX_SILENCE_NS = 2_000_000_000
"""Time without a sample after which a part is told as silent. Basis: a choice; two periods of the slowest rate of any chip."""


class EndOfRecording(Exception):  # noqa: N818  (not an error: a replayed recording has been read to its end)
    """The recording has been read to its end."""


class Device(Protocol):
    """A source of sample blocks. All calls come from one thread."""

    def open(self) -> DeviceInfo:
        """Find, identify and configure the part; may be called again after `close`. Raises `DeviceError`."""
        ...

    def read(self) -> SampleBlock | None:
        """Wait up to half a second for the next block; None if nothing came.

        Raises `DeviceError` when the part has to be opened again, `EndOfRecording` at the end of a recording.
        """
        ...

    def close(self) -> None:
        """Release the bus or port; never raises, may be called twice."""
        ...

    @property
    def faults(self) -> Mapping[str, int]:
        """Number of faults since construction that did not stop the device, by name (`overrun`, `checksum`, ...)."""
        ...
