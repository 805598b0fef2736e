"""The parameter vector of a simulator: the meaning of each of its values."""

import math
from dataclasses import dataclass

from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.parameter import EVENT_TIME_KINDS, Parameter, ParameterKind, parameter_label

TILTS = (
    ("tilt_x_rad", "rad", 3.1),
    ("tilt_y_rad", "rad", 1.5),
    ("rate_x_rad_s", "rad/s", 50.0),
    ("rate_y_rad_s", "rad/s", 50.0),
)
"""Name, unit and limit of each coordinate. Basis: the tilt toward y is an arc sine, so it must stay below 90 degrees."""
HEADING = ("heading_rad", "rad", 7.0)
"""The same for the heading of the housing."""
STRETCH = (("stretch_m", "m", 0.5), ("stretch_rate_m_s", "m/s", 5.0))
"""The same for the stretch of an elastic rope."""
CONTACT = (("contact_x_rad", "rad", 0.2), ("contact_y_rad", "rad", 0.2))
"""The same for the rotation of the pivot's contact before it slides."""
BOW = (("bow_x_m", "m", 5.0), ("bow_y_m", "m", 5.0), ("bow_rate_x_m_s", "m/s", 50.0), ("bow_rate_y_m_s", "m/s", 50.0))
"""The same for the bow of a heavy rope."""
INITIAL_STATE_SCALE = 1e-3
"""A change of an initial state that an operator would call small. Basis: a choice; a milliradian or millimetre."""


@dataclass(frozen=True, slots=True)
class ParameterSpec:
    """One number of the parameter vector."""

    label: str
    """`steady_wind.accel_m_s2[x]`, `initial.tilt_x_rad`."""
    effect: str
    """Name of the effect; empty for an initial state."""
    parameter: str
    component: int
    unit: str
    lower: float
    upper: float
    neutral: float
    scale: float
    refitted: bool
    """True for a nuisance parameter, which belongs to a recording and not to the rig: initial states, heading, phases."""
    kind: ParameterKind = ParameterKind.AMPLITUDE
    step_limit: float = math.inf

    @property
    def is_event_time(self) -> bool:
        """Whether the number determines when an event acts, and not how strongly."""
        return self.kind in EVENT_TIME_KINDS

    @property
    def is_cutoff(self) -> bool:
        """Whether the number is a cutoff frequency, which is fitted by its inverse."""
        return self.kind is ParameterKind.CUTOFF


def initial_state_specs(structure: ModelStructure) -> tuple[ParameterSpec, ...]:
    """Return the coordinates of the initial state."""
    kinds = [*TILTS, HEADING]
    if structure is ModelStructure.RIGGING:
        kinds += [(f"rigging_{name}", unit, limit) for name, unit, limit in TILTS]
    if structure is ModelStructure.ELASTIC:
        kinds += STRETCH
    if structure is ModelStructure.PRESLIDING:
        kinds += CONTACT
    if structure is ModelStructure.HEAVY_ROPE:
        kinds += BOW
    return tuple(
        ParameterSpec(f"initial.{name}", "", name, 0, unit, -limit, limit, 0.0, INITIAL_STATE_SCALE, True)
        for name, unit, limit in kinds
    )


def effect_parameter_specs(effect: Effect, length_m: float) -> tuple[ParameterSpec, ...]:
    """Return the numbers of an effect on a rope of this nominal length."""
    return tuple(_spec(effect, p, i, length_m) for p in effect.parameters for i in range(p.size))


def _spec(effect: Effect, p: Parameter, component: int, length_m: float) -> ParameterSpec:
    label, upper = f"{effect.name}.{parameter_label(p, component)}", effect.upper_bound(p, length_m)
    neutral = min(p.neutral, upper)
    return ParameterSpec(
        label,
        effect.name,
        p.name,
        component,
        p.unit,
        p.lower,
        upper,
        neutral,
        p.scale,
        p.refitted,
        p.kind,
        p.step_limit,
    )
