"""Words for the quality of the data, for what was fitted again, and for the rig."""

from gateway.documents.format import format_number
from gateway.twin.model import TwinRig

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


def rig_facts(rig: TwinRig) -> Facts:
    """Return the rig as it was described."""
    return (
        ("rope, pivot to the load’s centre", f"{format_number(rig.length_m, 5)} m"),
        ("housing, pivot to the sensor", f"{format_number(rig.position_m, 5)} m"),
        ("gravity", f"{format_number(rig.gravity_m_s2, 6)} m/s²"),
        ("noise σ of x, y, z", f"{', '.join(format_number(1e3 * each) for each in rig.noise_g)} mg"),
        ("sample rate", f"{format_number(rig.sample_rate_hz)} Hz" if rig.sample_rate_hz is not None else "not given"),
        ("full scale", f"{format_number(rig.full_scale_g)} g" if rig.full_scale_g is not None else "not given"),
    )
