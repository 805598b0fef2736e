"""The configuration that the files of a recording have in common."""

from collections.abc import Sequence

from devices.errors import RecordingError
from gateway.configuration.model import Configuration
from gateway.recording.reading.correction_in_force import recorded_configuration
from gateway.recording.reading.samples import SampledFile


def common_configuration(files: Sequence[SampledFile], *, same_rig: bool) -> Configuration | None:
    """Return the configuration of the first file.

    Raises `RecordingError` where another file has other axes, or, with `same_rig`, another rope, housing or gravity.
    """
    first, *others = (recorded_configuration(each.file) for each in files)
    for file, other in zip(files[1:], others, strict=True):
        settings = _settings(other, same_rig=same_rig)
        for name, value in _settings(first, same_rig=same_rig).items():
            if settings.get(name) != value:
                raise RecordingError(
                    f"{file.path}: was recorded with another {name} than {files[0].path}; measure them one by one"
                )
    return first


def _settings(configuration: Configuration | None, *, same_rig: bool) -> dict[str, object]:
    """Return the settings that all files of one recording must share."""
    if configuration is None:
        return {"configuration": None}
    settings: dict[str, object] = {"configuration": "recorded", "device.axes_map": configuration.device.axes}
    rig: dict[str, object] = {
        "rope.length_m": configuration.rope.length_m,
        "position of the housing": configuration.housing,
        "gravity": configuration.site.local_gravity_m_s2,
    }
    return settings | rig if same_rig else settings
