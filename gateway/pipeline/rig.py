"""The rig as it is stated, in a file `rig.toml` or in the configuration, and its one conversion to the rig of the estimators."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration, HousingPlace
from gateway.configuration.section import Section
from gateway.numerics.array import Array
from gateway.swing.model.mount import rotation
from gateway.swing.rig import NOMINAL_LENGTH_U_REL, MountedHousing

UNSTATED_GRAVITY_U_REL = 1.5e-3
"""Standard uncertainty of the gravity of a site that nobody stated. Basis: 9.780 m/s² at the equator to 9.832 at the poles."""
MAX_LENGTH_SIGMA = 2.0
"""Standard uncertainties of the length by which the housing may stand beyond the nominal rope. Basis: a housing below its load
cannot exist; the hook may hang lower than the nominal length says, by what is stated of its uncertainty."""
BESIDE_U_M = 0.015
"""Standard uncertainty of the sensor's place across the rope, per axis. Basis: a housing is clamped beside a rope, not in it."""
MOUNT_U_RAD = 0.01
"""Standard uncertainty of the angle between the housing's z axis and the rope, clamped by eye, for the offline fit. Basis: by eye
an edge is parallel to a rope within one degree, uniformly distributed."""

MIN_LENGTH_OVER_ABOVE_LOAD = 1.02
"""Shortest rope over the housing's distance above the load: the distance is measured, the rope's length is a belief. Basis: a
choice; above the error of the tape on a long rope, and below any rope that hangs above its housing."""
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
"""Uncertainties of readings in the product's own form, which are calibrated. Basis: the reading of a tape measure."""
CONFIGURED = DefaultUncertainty(position_u_m=0.05, position_u_rel=0.0)
"""Uncertainties of a rig in the configuration. Basis: a choice; a tape measures to millimetres, and the middle of a load is
known to centimetres."""
UNCALIBRATED = DefaultUncertainty(
    position_u_m=0.005, position_u_rel=0.01, offset_u_g=0.02, scale_u=0.01, cross_axis_u=0.01
)
"""Uncertainties of readings of another program. Basis: where in its case a sensor is; limits of 40 mg, 2 % and 2 % in the data
sheets of parts in phones and radio boards."""


class RigRope(Section):
    """The rope."""

    length_m: Positive
    length_u_rel: Annotated[float, Field(gt=0, lt=1)] = NOMINAL_LENGTH_U_REL


class RigHousing(HousingPlace):
    """The position of the housing on the rope, from the pivot or above the load, and how it is mounted."""

    position_u_m: NotNegative | None = None
    beside_u_m: NotNegative = BESIDE_U_M
    mount_deg: list[MountAngle] = Field([0.0, 0.0], min_length=2, max_length=2)
    mount_u_deg: NotNegative | None = None


class RigSensor(Section):
    """The sensor in the housing."""

    sample_rate_hz: Positive | None = None
    noise_g: Positive | Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = None
    full_scale_g: Positive | None = None
    bandwidth_hz: Positive | None = None
    offset_mg: list[float] = Field([0.0, 0.0, 0.0], min_length=3, max_length=3)
    offset_u_mg: NotNegative | PerAxis | None = None
    scale: Positive | Annotated[list[Positive], Field(min_length=3, max_length=3)] = 1.0
    scale_u: NotNegative | PerAxis | None = None


class RigSite(Section):
    """The site of the crane."""

    gravity_m_s2: Annotated[float, Field(gt=9.7, lt=9.9)] = STANDARD_GRAVITY_M_S2


class Rig(Section):
    """A rig as stated: the content of a `rig.toml`."""

    rope: RigRope
    housing: RigHousing
    sensor: RigSensor = RigSensor()
    site: RigSite = RigSite()
    model: dict[str, dict[str, Any]] = Field({})

    @model_validator(mode="after")
    def _check_position(self) -> "Rig":
        position_m, length_m = self.housing.position_m, self.rope.length_m
        if position_m is None and self.housing.above_load_m is None:
            raise ValueError("[housing] wants either position_m or above_load_m")
        # The nominal length may be outdated by hoisting, whereas the position of the housing was measured.
        longest_m = length_m * (1 + MAX_LENGTH_SIGMA * self.rope.length_u_rel)
        if position_m is not None and position_m > longest_m:
            raise ValueError(
                f"housing.position_m {position_m:g} is below the load: rope.length_m is {length_m:g}, at most {longest_m:g} by "
                "its uncertainty rope.length_u_rel"
            )
        return self

    def mounted_housing(self, limits: DefaultUncertainty = CALIBRATED) -> MountedHousing:
        """Return the rig of the estimators, for readings to which `correct` was applied."""
        position_u_m = self.housing.position_u_m
        mount_u_deg = self.housing.mount_u_deg
        default_m = limits.position_u_m + limits.position_u_rel * self.rope.length_m
        return MountedHousing(
            length_m=self.rope.length_m,
            length_u_rel=self.rope.length_u_rel,
            position_m=self.housing.position_m,
            above_load_m=self.housing.above_load_m,
            mounted_on=self.housing.mounted_on,
            position_u_m=default_m if position_u_m is None else position_u_m,
            beside_u_m=self.housing.beside_u_m,
            mount_u_rad=None if mount_u_deg is None else math.radians(mount_u_deg),
            zero_g_offset_u_g=_per_axis(self.sensor.offset_u_mg, 1e-3, limits.offset_u_g),
            scale_u=_per_axis(self.sensor.scale_u, 1.0, limits.scale_u),
            cross_axis_u=limits.cross_axis_u,
            bandwidth_hz=self.sensor.bandwidth_hz,
            gravity_m_s2=self.site.gravity_m_s2,
            gravity_u_rel=0.0 if "gravity_m_s2" in self.site.model_fields_set else UNSTATED_GRAVITY_U_REL,
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


def configured_housing(
    configuration: Configuration, correction: Correction, bandwidth_hz: float | None
) -> MountedHousing | None:
    """Return the rig of the estimators for a gateway's own readings; None where the housing's position is not configured."""
    if configuration.housing_position_m is None:
        return None
    above_m = configuration.housing_above_load_m
    rig = Rig(
        rope=RigRope(length_m=max(configuration.rope.length_m, MIN_LENGTH_OVER_ABOVE_LOAD * (above_m or 0.0))),
        housing=RigHousing(
            position_m=configuration.housing_position_m if above_m is None else None,
            above_load_m=above_m,
            mounted_on=configuration.housing.mounted_on,
            beside_u_m=0.0,
            mount_u_deg=0.0,  # a gateway zeroes the mount
        ),
        site=RigSite(gravity_m_s2=configuration.site.local_gravity_m_s2) if configuration.site.is_known else RigSite(),
    )
    return with_sensor(rig.mounted_housing(CONFIGURED), correction, bandwidth_hz)


def with_sensor(housing: MountedHousing, correction: Correction, bandwidth_hz: float | None) -> MountedHousing:
    """Return the housing with the uncertainties of the calibration and the bandwidth of the sensor."""
    x, y, z = correction.u_zero_g_offset_g.tolist()
    sx, sy, sz = correction.u_scale_factor.tolist()
    return replace(
        housing,
        zero_g_offset_u_g=(x, y, z),
        scale_u=(sx, sy, sz),
        cross_axis_u=math.hypot(MOUNT_U_RAD, correction.u_cross_axis),
        bandwidth_hz=bandwidth_hz,
    )
