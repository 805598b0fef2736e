"""Kinds of devices from other packages, found by the entry point group `plumbline.devices`."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any

from devices.clock import Clock
from devices.device import Device
from gateway.configuration.device_section import DeviceSection
from gateway.errors import PlumblineError

GROUP = "plumbline.devices"


class PluginError(PlumblineError):
    """A package with a kind of device cannot be used; the text names it and the reason."""


@dataclass(frozen=True, slots=True)
class DevicePlugin:
    """A kind of device: the object that an entry point names."""

    section: type[DeviceSection]
    """The keys of the section `[device]`, with `kind: Literal["..."]` equal to the name of the entry point."""
    make: Callable[[Any, int, Clock], Device]
    """Return the device, not yet opened, for a section, the samples per block and the clock."""


def plugin_names() -> list[str]:
    """Return the kinds of devices of all installed packages."""
    return sorted(entry_points(group=GROUP).names)


def load_plugin(name: str) -> DevicePlugin:
    """Return the kind of device of that name. Raises `PluginError` where it cannot be loaded."""
    (entry,) = entry_points(group=GROUP, name=name)
    try:
        plugin = entry.load()
    except Exception as error:  # of a foreign package: whatever it raises, it cannot be used
        raise PluginError(f"device.kind {name!r}: {entry.value} cannot be loaded: {error}") from error
    if not isinstance(plugin, DevicePlugin):
        raise PluginError(f"device.kind {name!r}: {entry.value} is not a DevicePlugin")
    return plugin
