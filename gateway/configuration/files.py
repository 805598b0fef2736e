"""The files that a configuration names."""

from gateway.configuration.device_sections import ReplayDevice
from gateway.configuration.model import Configuration


def missing_files(configuration: Configuration) -> list[str]:
    """Return a phrase for each file that the configuration names and that does not exist."""
    files = {f"bus.tls.{name}": path for name, path in configuration.bus.tls.files.items()}
    if isinstance(configuration.device, ReplayDevice):
        files["device.path"] = configuration.device.path
    return [f"{key}: {path}: there is no such file" for key, path in files.items() if not path.is_file()]
