"""The manifest of the recordings of real pendulums, real_recordings.toml."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

MANIFEST = Path(__file__).with_name("real_recordings.toml")


@dataclass(frozen=True, slots=True, kw_only=True)
class RealRecording:
    """An entry of the manifest."""

    name: str
    path: str
    source: str
    licence: str
    sha256: str
    rig: str
    options: Sequence[str] = ()
    angle: Mapping[str, float] = field(default_factory=dict)
    """The file is a table of angles: its columns, units, zero and the part that is used; see `real_angles`."""
    attitude: Mapping[str, float] = field(default_factory=dict)
    """Columns of the quaternion of an independent instrument beside the accelerometer; see `real_angles`."""
    known_deg: tuple[float, float]
    """Largest angle of the whole recording and its standard uncertainty, known independently."""
    known_from: str
    plausible: Sequence[str] = ()
    """Effects that an engineer would sign."""
    refused_because: str = ""
    """Why no answer can be given; empty where one can."""

    @property
    def is_asked_once(self) -> bool:
        """Whether nobody looked at it before the code was finished."""
        return self.path.startswith("fresh/")


def read_manifest() -> list[RealRecording]:
    """All entries."""
    entries = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["recording"]
    return [RealRecording(**{**entry, "known_deg": tuple(entry["known_deg"])}) for entry in entries]
