"""The file `rig.toml`, and a rig whose file leaves the rope's length out."""

from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from gateway.errors import InputError, describe_problems
from gateway.file_input import MAX_TOML_BYTES, parse_toml, read_bounded
from gateway.pipeline.rig import Rig

NO_LENGTH_M = 1e3
"""Stands for a length that is not stated, while the rest of a rig is validated. Basis: a choice; longer than any rope, so that no
check of a length fails."""


def rig_without_length(path: Path) -> float | None:
    """Return the site's gravity where a file states no rope length; None where it does, or cannot be read.

    Raises `InputError` where another value is wrong.
    """
    try:
        rope = parse_toml(read_bounded(path, MAX_TOML_BYTES).decode()).get("rope", {})
    except (OSError, ValueError):
        return None
    if not isinstance(rope, dict) or "length_m" in rope:
        return None
    return read_rig(path, {"length_m": NO_LENGTH_M}).site.gravity_m_s2


def read_rig(path: Path, rope: Mapping[str, float] | None = None) -> Rig:
    """Return the rig of a file, with values of the rope where the file states none. Raises `InputError` with the remedy."""
    try:
        table = parse_toml(read_bounded(path, MAX_TOML_BYTES).decode())
        if rope is not None:
            table = table | {"rope": dict(rope) | table.get("rope", {})}
        return Rig.model_validate(table)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except ValidationError as error:
        is_missing = error.errors(include_url=False)[0]["type"] == "missing"
        remedy = "; needed are [rope] length_m and [housing] position_m" if is_missing else ""
        raise InputError(f"{path}: {describe_problems(error, 'rig')[0]}{remedy}") from error
    except ValueError as error:
        raise InputError(f"{path}: is not TOML: {error}") from error
