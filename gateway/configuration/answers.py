"""A configuration in the making: answers key by key, each checked with all that were given before."""

from typing import Any

from gateway.configuration.loading import ConfigurationError, configuration_class, validate
from gateway.configuration.model import Configuration
from gateway.configuration.render import to_toml

Table = dict[str, Any]

REQUIRED = ("device.kind", "rope.length_m")
POSITION = ("housing.above_load_m", "housing.position_m")


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
