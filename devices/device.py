"""The protocol that every source of samples keeps: a chip, a radio, a recording, a simulation."""

from collections.abc import Mapping
from typing import Protocol

from devices.block import DeviceInfo, SampleBlock


class EndOfRecording(Exception):  # noqa: N818  (not an error: a replayed recording has been read to its end)
    """The device has no more samples and never will."""


class Device(Protocol):
    """A source of sample blocks. All calls come from one thread."""

    def open(self) -> DeviceInfo:
        """Find, identify and configure the part; may be called again after `close`. Raises `DeviceError`."""
        ...

    def read(self) -> SampleBlock | None:
        """Wait for the next burst, at most half a second; None when nothing came.

        Raises `DeviceError` when the part has to be opened again, `EndOfRecording` when there is no more.
        """
        ...

    def close(self) -> None:
        """Release the bus or port; never raises, may be called twice."""
        ...

    @property
    def faults(self) -> Mapping[str, int]:
        """Counts of what went wrong and was survived since construction, by name (`overrun`, `checksum`, ...)."""
        ...
