"""The configuration of the service that `deploy/install.sh` has installed on this machine."""

import os
from collections.abc import Mapping
from pathlib import Path

from gateway.configuration.loading import ConfigurationError, load
from gateway.configuration.model import Configuration

SETTINGS = Path("/etc/plumbline/plumbline.toml")
SERVICE_ENVIRONMENT = Path("/etc/default/plumbline")
WITHOUT_SENSOR = ("simulated", "replay")


def is_installed() -> bool:
    """Return whether this machine has an installed configuration."""
    return SETTINGS.exists()


def load_installed(environment: Mapping[str, str] = os.environ) -> Configuration:
    """Return the configuration that the service runs with. Raises `ConfigurationError`."""
    return load(SETTINGS, {**service_environment(), **environment})


def require_sensor(configuration: Configuration, where: str) -> None:
    """Raise `ConfigurationError` for a service without a sensor that is not declared a demonstration."""
    kind = configuration.device.kind
    if kind in WITHOUT_SENSOR and not configuration.gateway.demonstration:
        raise ConfigurationError(
            f'{where}: device.kind: "{kind}" is no sensor, and a service must not report a crane that is not there; '
            "name the sensor, or set gateway.demonstration = true"
        )


def service_environment() -> dict[str, str]:
    """Return the variables that the service's unit sets. Raises `ConfigurationError`."""
    try:
        lines = SERVICE_ENVIRONMENT.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ConfigurationError(f"{SERVICE_ENVIRONMENT}: cannot be read ({error.strerror})") from error
    pairs = (line.partition("=") for line in lines if line.strip() and not line.lstrip().startswith("#"))
    return {name.strip(): value.strip() for name, _, value in pairs}
