"""The file `rig.toml`: the nominal description of rope, housing, sensor and site."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from gateway.errors import InputError, describe_problems
from gateway.file_input import MAX_TOML_BYTES, parse_toml, read_bounded
from gateway.swing.rig import MountedHousing

LARGEST_RHO = 2.0
"""Largest position of the housing relative to the nominal length: the hook may hang lower than the nominal length says."""
Positive = Annotated[float, Field(gt=0)]


class RigTable(BaseModel):
    """A table of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RigRope(RigTable):
    """The rope."""

    length_m: Positive


class RigHousing(RigTable):
    """The position of the housing on the rope: from the pivot, or above the load."""

    position_m: Annotated[float, Field(ge=0)] | None = None
    above_load_m: Annotated[float, Field(ge=0)] | None = None


class RigSensor(RigTable):
    """The sensor in the housing."""

    sample_rate_hz: Positive | None = None
    noise_g: Positive | Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = None
    full_scale_g: Positive | None = None
    bandwidth_hz: Positive | None = None


class RigSite(RigTable):
    """The site of the crane."""

    gravity_m_s2: Annotated[float, Field(gt=9.7, lt=9.9)] = STANDARD_GRAVITY_M_S2


class Rig(RigTable):
    """The content of the file."""

    rope: RigRope
    housing: RigHousing
    sensor: RigSensor = RigSensor()
    site: RigSite = RigSite()
    model: dict[str, dict[str, Any]] = {}

    @model_validator(mode="after")
    def _check_position(self) -> "Rig":
        position_m, length_m = self.housing.position_m, self.rope.length_m
        if (position_m is None) == (self.housing.above_load_m is None):
            raise ValueError("[housing] wants either position_m or above_load_m")
        # The nominal length may be outdated by hoisting, whereas the position of the housing was measured.
        if position_m is not None and position_m > LARGEST_RHO * length_m:
            raise ValueError(f"housing.position_m {position_m:g} is far beyond rope.length_m {length_m:g}")
        return self

    def mounted_housing(self) -> MountedHousing:
        """Return the housing for the swing estimator."""
        return MountedHousing(
            length_m=self.rope.length_m,
            position_m=self.housing.position_m,
            above_load_m=self.housing.above_load_m,
            gravity_m_s2=self.site.gravity_m_s2,
        )


def read_rig(path: Path) -> Rig:
    """Return the rig of a file. Raises `InputError` with the place and the remedy."""
    try:
        return Rig.model_validate(parse_toml(read_bounded(path, MAX_TOML_BYTES).decode()))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except ValidationError as error:
        problem = describe_problems(error, "rig")[0]
        raise InputError(f"{path}: {problem}; needed are [rope] length_m and [housing] position_m") from error
    except ValueError as error:
        raise InputError(f"{path}: is not TOML: {error}") from error
