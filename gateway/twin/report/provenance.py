"""How good the data were, what was fitted again, and how everything was computed."""

from collections.abc import Mapping

from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.markup import Html, element, facts, items, missing, paragraph, section
from gateway.twin.report.words import number, plain

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
    "initial.tilt_x_rad": "how far the rope leant along x at the start",
    "initial.tilt_y_rad": "how far the rope leant along y at the start",
    "initial.rate_x_rad_s": "how fast it swung along x at the start",
    "initial.rate_y_rad_s": "how fast it swung along y at the start",
    "initial.heading_rad": "which way the housing faced",
}
WORDS = (
    ("Residual", "measured − simulated."),
    ("σ", "the sensor’s noise of one sample, as the rig’s description gives it; 95 % of noise lies within ±2 σ."),
    ("Gap, reduced chi-square", "mean square of the residual in units of σ. 1: noise alone."),
    (
        "Held-out",
        "data that the model was not fitted to: a model that merely bends itself to one recording fails there.",
    ),
    ("White", "without memory, as noise is; what is left is white when there is nothing left to explain."),
    (
        "Model as believed",
        "the pendulum of the rig’s description, with the initial motion of the load fitted and nothing else.",
    ),
)


def data_part(result: Reconciliation) -> Html:
    """Counts of samples, and what was fitted again on held-out data."""
    counts = facts((COUNTED.get(name, plain(name)), str(count)) for name, count in result.counts.items())
    return section(
        "The data",
        counts if result.counts else missing("Samples were not counted."),
        paragraph(
            "Lone spikes and invalid samples are left out of every picture and number above; they are counted here."
        )
        if result.counts and result.log is not None
        else "",
        element("h3", "Fitted again on held-out data"),
        _refitted(result),
        name="data",
    )


def _refitted(result: Reconciliation) -> Html:
    if not result.refitted_on_held_out:
        return paragraph("Nothing was fitted again on held-out data.")
    names = (
        element("li", *([f"{REFITTED[name]} "] if name in REFITTED else []), element("code", name))
        for name in result.refitted_on_held_out
    )
    return element(
        "div", paragraph("Only what belongs to a recording and not to the crane or the sensor:"), element("ul", *names)
    )


def computed_part(result: Reconciliation, software: str, computed: Mapping[str, str]) -> Html:
    """What it takes to compute the same again, and the words used."""
    return section(
        "How this was computed",
        facts([("software", software), *computed.items()]),
        element("h3", "The rig, as believed before the data were looked at"),
        facts(_rig(result.rig)),
        element("h3", "Words"),
        items(element("span", element("strong", f"{word}: "), meaning) for word, meaning in WORDS),
        name="computed",
    )


def _rig(rig: TwinRig) -> list[tuple[str, str]]:
    return [
        ("rope, pivot to the load’s centre", f"{number(rig.length_m, 5)} m"),
        ("housing, pivot to the sensor", f"{number(rig.position_m, 5)} m"),
        ("gravity", f"{number(rig.gravity_m_s2, 6)} m/s²"),
        ("noise σ of x, y, z", f"{', '.join(number(1e3 * each) for each in rig.noise_g)} mg"),
        ("sample rate", f"{number(rig.sample_rate_hz)} Hz" if rig.sample_rate_hz is not None else "not given"),
        ("full scale", f"{number(rig.full_scale_g)} g" if rig.full_scale_g is not None else "not given"),
    ]
