"""The quality of the data, what was fitted again, and how everything was computed."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.documents.format import format_number
from gateway.documents.text import human_name
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import Reconciliation

Facts = tuple[tuple[str, str], ...]
COUNTED = {
    "read": "samples read",
    "used": "samples used",
    "spikes": "lone spikes",
    "lost": "lost",
    "repeated": "repeated times",
    "backward": "backward times",
    "invalid": "invalid",
}
REFITTED = {
    "initial.tilt_x_rad": "inclination of the rope along x at the start",
    "initial.tilt_y_rad": "inclination of the rope along y at the start",
    "initial.rate_x_rad_s": "rate of the swing along x at the start",
    "initial.rate_y_rad_s": "rate of the swing along y at the start",
    "initial.heading_rad": "heading of the housing",
}


@dataclass(frozen=True, slots=True)
class DataView:
    """The section on the data as it is printed."""

    counts: Facts
    has_curves: bool
    refitted: Facts
    """Meaning, empty where there is none, and name of each parameter that was fitted again on held-out data."""


@dataclass(frozen=True, slots=True)
class ComputedView:
    """The section on the computation as it is printed."""

    facts: Facts
    rig: Facts


def data_view(result: Reconciliation) -> DataView:
    """Return counts of samples, and the parameters that were fitted again on held-out data."""
    return DataView(
        counts=tuple((COUNTED.get(name, human_name(name)), str(count)) for name, count in result.counts.items()),
        has_curves=result.log is not None,
        refitted=tuple((REFITTED.get(name, ""), name) for name in result.refitted_on_held_out),
    )


def computed_view(result: Reconciliation, software: str, computed: Mapping[str, str]) -> ComputedView:
    """Return what it takes to compute the same again."""
    return ComputedView((("software", software), *computed.items()), _rig(result.rig))


def _rig(rig: TwinRig) -> Facts:
    return (
        ("rope, pivot to the load’s centre", f"{format_number(rig.length_m, 5)} m"),
        ("housing, pivot to the sensor", f"{format_number(rig.position_m, 5)} m"),
        ("gravity", f"{format_number(rig.gravity_m_s2, 6)} m/s²"),
        ("noise σ of x, y, z", f"{', '.join(format_number(1e3 * each) for each in rig.noise_g)} mg"),
        ("sample rate", f"{format_number(rig.sample_rate_hz)} Hz" if rig.sample_rate_hz is not None else "not given"),
        ("full scale", f"{format_number(rig.full_scale_g)} g" if rig.full_scale_g is not None else "not given"),
    )
