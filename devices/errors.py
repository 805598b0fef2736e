"""What can go wrong between the wire and a sample block."""


class DeviceError(Exception):
    """A device cannot do what was asked. The text names the place and the mend in one line."""


class DeviceNotFoundError(DeviceError):
    """No bus, port, file or address of that name."""


class DeviceAccessError(DeviceError):
    """The bus or port exists, and this user may not open it."""


class IdentityError(DeviceError):
    """Something answers, and it is not the part that the configuration names."""


class ConfigurationReadBackError(DeviceError):
    """A register did not keep what was written: a brown-out, a bad cable or a wrong part."""


class TransferError(DeviceError):
    """A transfer failed: no acknowledge, a time-out, a closed port. Worth another try."""


class RecordingError(DeviceError):
    """A recording cannot be read: missing, empty, truncated beyond use, or of another form."""
