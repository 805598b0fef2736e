"""The configuration as TOML with comments."""

from collections.abc import Mapping
from typing import Any

import tomli_w

from gateway.configuration.model import Configuration
from gateway.configuration.section import Section


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
