"""The configuration as TOML with comments."""

import tomli_w

from gateway.configuration.model import Configuration
from gateway.configuration.section import Section


def to_toml(configuration: Configuration) -> str:
    """Return the whole configuration with its defaults; a comment explains each key."""
    parts = []
    for name in Configuration.model_fields:
        parts.append(_table([name], getattr(configuration, name)))
    return "\n".join(parts)


def _table(path: list[str], section: Section) -> str:
    """Return one table: its keys, then its sub-tables."""
    lines, tables = [f"[{'.'.join(path)}]"], []
    values = section.model_dump(mode="json")
    for key, field in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, Section):
            tables.append("\n" + _table([*path, key], value))
            continue
        setting = f"# {key} =" if value is None else tomli_w.dumps({key: values[key]}).rstrip()
        lines.append(setting + (f"  # {field.description}" if field.description else ""))
    return "\n".join(lines) + "\n" + "".join(tables)
