"""The file `rig.toml`: the nominal description of rope, housing, sensor and site."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from gateway.errors import InputError, describe_problems
from gateway.file_input import MAX_TOML_BYTES, parse_toml, read_bounded
from gateway.numerics.array import Array
from gateway.swing.model.mount import rotation
from gateway.swing.rig import MountedHousing

NO_LENGTH_M = 1e3
"""Stands for a length that is not stated, while the rest of a rig is validated. Basis: a choice; longer than any rope, so that no
check of a length fails."""
LARGEST_RHO = 2.0
"""Largest position of the housing relative to the nominal length. Basis: the hook may hang lower than the nominal length says."""
BESIDE_U_M = 0.015
"""Standard uncertainty of the sensor's place across the rope, per axis. Basis: a housing is clamped beside a rope, not in it."""
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
MountAngle = Annotated[float, Field(gt=-90, lt=90)]
PerAxis = Annotated[list[NotNegative], Field(min_length=3, max_length=3)]


@dataclass(frozen=True, slots=True)
class DefaultUncertainty:
    """Standard uncertainties of the housing's position, and of the sensor, where the rig states none."""

    position_u_m: float
    position_u_rel: float
    """Further uncertainty of the position, over the rope's length."""
    offset_u_g: float = 0.0
    scale_u: float = 0.0
    cross_axis_u: float = 0.0


CALIBRATED = DefaultUncertainty(position_u_m=0.001, position_u_rel=0.0)
"""Of readings in the product's own form, which are calibrated. Basis: the reading of a tape measure."""
UNCALIBRATED = DefaultUncertainty(
    position_u_m=0.005, position_u_rel=0.01, offset_u_g=0.02, scale_u=0.01, cross_axis_u=0.01
)
"""Of readings of another program. Basis: where in its case a sensor is; limits of 40 mg, 2 % and 2 % in the data sheets of
parts in phones and radio boards."""


class RigTable(BaseModel):
    """A table of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RigRope(RigTable):
    """The rope."""

    length_m: Positive
    length_u_rel: Annotated[float, Field(gt=0, lt=1)] = 0.2


class RigHousing(RigTable):
    """The position of the housing on the rope, from the pivot or above the load, and how it is mounted."""

    position_m: NotNegative | None = None
    above_load_m: NotNegative | None = None
    position_u_m: NotNegative | None = None
    beside_u_m: NotNegative = BESIDE_U_M
    mount_deg: Annotated[list[MountAngle], Field(min_length=2, max_length=2)] = [0.0, 0.0]
    mount_u_deg: NotNegative | None = None


class RigSensor(RigTable):
    """The sensor in the housing."""

    sample_rate_hz: Positive | None = None
    noise_g: Positive | Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = None
    full_scale_g: Positive | None = None
    bandwidth_hz: Positive | None = None
    offset_mg: Annotated[list[float], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    offset_u_mg: NotNegative | PerAxis | None = None
    scale: Positive | Annotated[list[Positive], Field(min_length=3, max_length=3)] = 1.0
    scale_u: NotNegative | PerAxis | None = None


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

    def mounted_housing(self, limits: DefaultUncertainty = CALIBRATED) -> MountedHousing:
        """Return the housing for the swing estimator, for readings to which `correct` was applied."""
        position_u_m = self.housing.position_u_m
        mount_u_deg = self.housing.mount_u_deg
        default_m = limits.position_u_m + limits.position_u_rel * self.rope.length_m
        return MountedHousing(
            length_m=self.rope.length_m,
            length_u_rel=self.rope.length_u_rel,
            position_m=self.housing.position_m,
            above_load_m=self.housing.above_load_m,
            position_u_m=default_m if position_u_m is None else position_u_m,
            beside_u_m=self.housing.beside_u_m,
            mount_u_rad=None if mount_u_deg is None else math.radians(mount_u_deg),
            zero_g_offset_u_g=_per_axis(self.sensor.offset_u_mg, 1e-3, limits.offset_u_g),
            scale_u=_per_axis(self.sensor.scale_u, 1.0, limits.scale_u),
            cross_axis_u=limits.cross_axis_u,
            bandwidth_hz=self.sensor.bandwidth_hz,
            gravity_m_s2=self.site.gravity_m_s2,
        )

    def correct(self, readings_g: Array) -> Array:
        """Return readings, shape (n, 3), without the stated offset, scale and mount: in the axes of the rope."""
        corrected = (readings_g - 1e-3 * np.array(self.sensor.offset_mg)) / np.array(self.sensor.scale)
        return self.turn(corrected)

    def turn(self, vectors: Array) -> Array:
        """Return vectors in the housing's axes, shape (n, 3), in those of the rope as the mount is stated."""
        turned: Array = vectors @ rotation(np.radians(self.housing.mount_deg))
        return turned


def _per_axis(stated: float | list[float] | None, unit: float, default: float) -> tuple[float, float, float]:
    if stated is None:
        return default, default, default
    x, y, z = (np.ones(3) * stated * unit).tolist()
    return x, y, z


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
