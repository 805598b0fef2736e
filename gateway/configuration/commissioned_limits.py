"""The limits of the alerts as they were before they were first changed over the bus, in a file of the data folder.

While the limits in force are others, the gateway says so. A limit that a person sets in the file of the configuration, on the
gateway's own machine, is commissioned by that; one that came over the bus is accepted by deleting this file.
"""

import hashlib
import json
from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from gateway.atomic_io import make_folder, write_durably
from gateway.configuration.model import AlertsSection
from gateway.file_input import read_bounded

NAME = Path("configuration") / "commissioned.json"
"""Place in the data folder."""
Limits = dict[str, float]
"""Values in the units of the configuration, by key of its section `[alerts]`."""


class CommissionedLimits(BaseModel):
    """Content of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    commissioned: Limits
    changed: Limits
    """What was last set over the bus."""
    sha256: str = ""

    @model_validator(mode="after")
    def _check_sum(self) -> Self:
        if self.sha256 != self.checksum:
            raise ValueError("its checksum is wrong")
        return self

    @property
    def checksum(self) -> str:
        """SHA-256 of the limits."""
        return hashlib.sha256(json.dumps([self.commissioned, self.changed], sort_keys=True).encode()).hexdigest()


def note_change(data_dir: Path, before: AlertsSection, after: AlertsSection) -> None:
    """Keep what was commissioned before limits are changed over the bus. Raises `OSError`."""
    old, new = _limits(before), _limits(after)
    if old == new:
        return
    try:
        known = _read(data_dir)
    except ValueError:
        return  # it is said that it cannot be read, until a person deletes it
    if known is not None:
        old = {
            key: known.commissioned.get(key, value)
            if value in (known.commissioned.get(key), known.changed.get(key))
            else value
            for key, value in old.items()
        }
    unsigned = CommissionedLimits.model_construct(commissioned=old, changed=new)
    path = data_dir / NAME
    make_folder(path.parent)
    write_durably(path, unsigned.model_copy(update={"sha256": unsigned.checksum}).model_dump_json(indent=1).encode())


def describe_changes(data_dir: Path, present: AlertsSection) -> list[str]:
    """Return a line for each limit that was changed over the bus and is not as it was commissioned."""
    accept = f"; to accept it, delete {data_dir / NAME} and restart the gateway"
    try:
        known = _read(data_dir)
    except (OSError, ValueError) as error:
        return [f"the limits of commissioning cannot be read ({error}){accept}"]
    if known is None:
        return []
    return [
        f"alerts.{key} is {value:g}, changed over the bus; at commissioning it was {known.commissioned[key]:g}{accept}"
        for key, value in _limits(present).items()
        if key in known.commissioned and value == known.changed.get(key) != known.commissioned[key]
    ]


def _limits(section: AlertsSection) -> Limits:
    return {key: float(value) for key, value in section.model_dump().items()}


def _read(data_dir: Path) -> CommissionedLimits | None:
    """Return the content of the file; None: there is none. Raises `OSError` and `ValueError`."""
    path = data_dir / NAME
    try:
        return CommissionedLimits.model_validate_json(read_bounded(path))
    except FileNotFoundError:
        if path.is_symlink():
            raise
        return None
    except ValidationError as error:
        raise ValueError(f"{error.error_count()} problems") from error
