"""Reading of a configuration from a TOML file and the environment, or one line that names the key and the correct value.

Also a configuration in the making, by answers key by key, and as TOML with comments. The installed configuration is that of the
service, which `deploy/install.sh` has set up on this machine.
"""

import difflib
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ValidationError, create_model

from gateway.configuration.device_plugins import PluginError, load_plugin, plugin_names
from gateway.configuration.device_sections import DEVICE_SECTIONS, ReplayDevice
from gateway.configuration.model import Configuration
from gateway.configuration.section import Section
from gateway.errors import InputError, describe_problem
from gateway.file_input import parse_toml, read_toml

ENVIRONMENT_PREFIX = "PLUMBLINE_"
SETTINGS = Path("/etc/plumbline/plumbline.toml")
SERVICE_ENVIRONMENT = Path("/etc/default/plumbline")
WITHOUT_SENSOR = ("simulated", "replay")
Table = dict[str, Any]
REQUIRED = ("device.kind", "rope.length_m")
POSITION = ("housing.above_load_m", "housing.position_m")


class ConfigurationError(InputError):
    """The configuration cannot be used; the text names the file, the key and the remedy in one line."""


def load(
    path: Path | None, environment: Mapping[str, str] = os.environ, *, device: dict[str, Any] | None = None
) -> Configuration:
    """Return the configuration of a file, or the embedded default (a simulated crane), with the environment's overrides.

    `device` replaces the section of that name. Raises `ConfigurationError`.
    """
    table = {} if path is None else read_table(path)
    where = str(path) if path else "the embedded default"
    overridden = _override(table, environment)
    if device is not None:
        table["device"] = device
        overridden.append("--replay")
    return validate(table, where + (" with " + ", ".join(overridden) if overridden else ""))


def validate(table: dict[str, Any], where: str) -> Configuration:
    """Return the configuration of a parsed table; `where` names its source in the error. Raises `ConfigurationError`."""
    device = table.get("device")
    if isinstance(device, dict):
        device.setdefault("kind", "simulated")
        device_kind = device["kind"]
    else:
        device_kind = None
    try:
        model = configuration_class(device_kind)
    except PluginError as error:
        raise ConfigurationError(f"{where}: {error}") from error
    try:
        return model.model_validate(table)
    except ValidationError as error:
        problems = [_describe(dict(problem), table, model) for problem in error.errors(include_url=False)]
        raise ConfigurationError(f"{where}: " + "; ".join(problems)) from error


def configuration_class(device_kind: object) -> type[Configuration]:
    """Return the configuration for a kind of device. A plug-in's kind brings its own keys. Raises `PluginError`."""
    if not isinstance(device_kind, str) or device_kind in DEVICE_SECTIONS or device_kind not in plugin_names():
        return Configuration
    section = load_plugin(device_kind).section
    return create_model("Configuration", __base__=Configuration, device=(section, ...))


def load_text(text: str, where: str, environment: Mapping[str, str] = os.environ) -> Configuration:
    """Return the configuration of a TOML text with the environment's overrides. Raises `ConfigurationError`."""
    try:
        table = parse_toml(text)
    except ValueError as error:
        raise ConfigurationError(f"{where}: is not TOML: {error}") from error
    _override(table, environment)
    return validate(table, where)


def read_table(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file. Raises `ConfigurationError`."""
    try:
        return read_toml(path)
    except FileNotFoundError as error:
        raise ConfigurationError(f"{path}: no such file; `plumbline config show` prints one to start from") from error
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise ConfigurationError(f"{path}: {error}") from error


def _override(table: dict[str, Any], environment: Mapping[str, str]) -> list[str]:
    """Put PLUMBLINE_<SECTION>__<KEY> of the environment into the table; return the names that were used."""
    used = []
    for name in sorted(environment):
        parts = name.removeprefix(ENVIRONMENT_PREFIX).lower().split("__")
        if not name.startswith(ENVIRONMENT_PREFIX) or len(parts) < 2:
            continue
        place = table
        for part in parts[:-1]:
            place = place.setdefault(part, {})
            if not isinstance(place, dict):
                raise ConfigurationError(f"{name}: {part} is a value, not a section")
        place[parts[-1]] = _environment_value(environment[name])
        used.append(name)
    return used


def _environment_value(text: str) -> Any:
    """Return the TOML value of a text, or the text itself where it is none."""
    try:
        return parse_toml(f"value = {text}")["value"]
    except ValueError:
        return text


def _describe(problem: dict[str, Any], table: dict[str, Any], model: type[Configuration]) -> str:
    """Describe one problem: the place, what is wrong, and what would be right."""
    place = [str(part) for part in problem["loc"]]
    if place[:1] == ["device"] and len(place) > 1 and place[1] in DEVICE_SECTIONS:
        del place[1]
    name = ".".join(place)
    if problem["type"] == "extra_forbidden":
        return f"{name}: unknown key{_suggestion(place, table, model)}"
    if problem["type"] == "union_tag_invalid":
        kinds = ", ".join([*DEVICE_SECTIONS, *plugin_names()])
        return f"device.kind: {table['device']['kind']!r} is not supported; this version has {kinds}"
    if problem["type"] == "missing":
        return f"{name}: is missing and has no default"
    text = describe_problem(problem)
    given = problem.get("input")
    shown = f" (given: {given!r})" if name and isinstance(given, str | int | float | bool) else ""
    return f"{name}: {text}{shown}" if name else text


def _suggestion(place: list[str], table: dict[str, Any], model: type[Configuration]) -> str:
    """Suggest the known key that was probably meant."""
    if len(place) == 1:
        known = list(Configuration.model_fields)
    else:
        kind = table["device"]["kind"] if place[0] == "device" else None
        section = _section_class(model, place[0], kind)
        known = list(_nested(section, place[1:-1]).model_fields)
    return suggest(place[-1], known)


def suggest(name: str, known: Collection[str]) -> str:
    """Return the known name that was probably meant, or all of them, as the end of a sentence."""
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"; did you mean {close[0]}?" if close else f"; known are {', '.join(known)}"


def _nested(section: type[BaseModel], path: list[str]) -> type[BaseModel]:
    for name in path:
        annotation = section.model_fields[name].annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            section = annotation
    return section


def _section_class(model: type[Configuration], section: str, device_kind: str | None) -> type[BaseModel]:
    if section == "device" and device_kind in DEVICE_SECTIONS:
        return DEVICE_SECTIONS[device_kind]
    annotation = model.model_fields[section].annotation
    if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
        raise TypeError(f"{section} is not a section")
    return annotation


def missing_files(configuration: Configuration) -> list[str]:
    """Return a phrase for each file that the configuration names and that does not exist."""
    files = {f"bus.tls.{name}": path for name, path in configuration.bus.tls.files.items()}
    if isinstance(configuration.device, ReplayDevice):
        files["device.path"] = configuration.device.path
    return [f"{key}: {path}: there is no such file" for key, path in files.items() if not path.is_file()]


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


def to_toml(configuration: Configuration, answered: Mapping[str, Any] | None = None) -> str:
    """Return the configuration with its defaults; a comment explains each key. Of answers, their sections and keys alone."""
    names = [name for name in type(configuration).model_fields if answered is None or name in answered]
    keys = {} if answered is None else answered
    return "\n".join(_table([name], getattr(configuration, name), keys.get(name)) for name in names)


def _table(path: list[str], section: Section, answered: Mapping[str, Any] | None) -> str:
    """Return one table: its keys, or those that are answered, then its sub-tables."""
    lines, tables = [f"[{'.'.join(path)}]"], []
    values = section.model_dump(mode="json") if answered is None else answered
    for key, value in values.items():
        inner = getattr(section, key)
        if isinstance(inner, Section):
            tables.append("\n" + _table([*path, key], inner, None if answered is None else value))
            continue
        description = type(section).model_fields[key].description
        setting = f"# {key} =" if value is None else tomli_w.dumps({key: value}).rstrip()
        lines.append(setting + (f"  # {description}" if description else ""))
    return "\n".join(lines) + "\n" + "".join(tables)


class Answers:
    """The keys that were answered; a refused answer changes nothing."""

    def __init__(self, table: Table | None = None) -> None:
        self.table: Table = {} if table is None else table

    def set(self, **answers: Any) -> None:
        """Set keys, written as `section__key`. Raises `ConfigurationError` where they contradict each other or an earlier one."""
        table = {section: dict(keys) for section, keys in self.table.items()}
        for name, value in answers.items():
            section, _, key = name.partition("__")
            table.setdefault(section, {})[key] = value
        validate({section: _copied(keys) for section, keys in table.items()}, "answer")
        self.table = table

    def get(self, name: str) -> Any:
        """Return the answer to a key such as `rope.length_m`; None: not answered."""
        section, _, key = name.partition(".")
        return self.table.get(section, {}).get(key)

    def complete(self, where: str) -> Configuration:
        """Return the configuration. Raises `ConfigurationError` where it is not valid or a key without a default is missing."""
        configuration = validate({section: _copied(keys) for section, keys in self.table.items()}, where)
        missing = [name for name in REQUIRED if self.get(name) is None]
        if missing:
            raise ConfigurationError(f"{where}: {missing[0]}: is missing; every installation has its own")
        if all(self.get(name) is None for name in POSITION):
            raise ConfigurationError(f"{where}: {POSITION[0]}: is missing: the distance of the housing above the load")
        return configuration

    def to_toml(self) -> str:
        """Return the answered keys as TOML; a comment explains each. All other keys keep their defaults."""
        model = configuration_class(self.get("device.kind"))
        return to_toml(model.model_validate(self.table), self.table)


def _copied(keys: Any) -> Any:
    """Return a copy of a section: validation adds defaults to the table that it is given."""
    return dict(keys) if isinstance(keys, dict) else keys
