"""The errors of devices."""

import errno

GONE_ERRNOS = (errno.ENODEV, errno.ENXIO, errno.ENOENT)
"""Errors by which the kernel says that a device is no longer there."""


class DeviceError(Exception):
    """A device cannot do what was asked. The text names the place and the remedy in one line."""


class DeviceNotFoundError(DeviceError):
    """There is no bus, port, file or address of that name."""


class DeviceAccessError(DeviceError):
    """The bus or port exists, but this user may not open it."""


class IdentityError(DeviceError):
    """The part that answers is not the one that the configuration names."""


class ConfigurationReadBackError(DeviceError):
    """A register did not keep what was written: a brown-out, a bad cable or a wrong part."""


class TransferError(DeviceError):
    """A transfer failed: no acknowledge, a timeout, a closed port. It may be tried again."""


class RecordingError(DeviceError):
    """A recording cannot be read: it is missing, empty, truncated or of another format."""
