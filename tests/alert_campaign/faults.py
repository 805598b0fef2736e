"""The faults, each with its mending after a random time."""

import random
import signal
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from tests.alert_campaign.site import GATEWAYS, RECEIVERS, Site

WIRE_FAULTS = {
    "delay of 0.7 s": ("delay_s", 0.7),
    "wire stalled": ("stalled", 1.0),
    "half of the datagrams lost": ("loss", 0.5),
    "half of the datagrams repeated": ("repeat", 0.5),
    "half of the datagrams reordered": ("reorder", 0.5),
}
TARGETS: dict[str, tuple[str, ...]] = {
    "link down": ("gateways", "receivers"),
    "gateway killed": GATEWAYS,
    "receiver killed": tuple(RECEIVERS),
    "receiver stalled": tuple(RECEIVERS),
    "router killed": ("router",),
    "router stalled": ("router",),
    "connections reset": ("wire reset",),
    **{kind: (f"wire {command}",) for kind, (command, _) in WIRE_FAULTS.items()},
}
"""What each kind of fault can hit; nothing is hit twice at once."""


@dataclass(frozen=True)
class Fault:
    """A fault that has begun."""

    kind: str
    target: str
    lasts_s: float
    mend: Callable[[], None]


def begin_fault(site: Site, kind: str, target: str, dice: random.Random) -> Fault:
    """Begin a fault."""
    lasts_s = dice.uniform(0.3, 4.0)
    match kind:
        case "link down":
            site.set_link(target, up=False)
            mend = partial(site.set_link, target, up=True)
        case "gateway killed" | "receiver killed" | "router killed":
            site.kill(target)
            mend = partial(site.start_party, target)
        case "receiver stalled" | "router stalled":
            lasts_s *= 2 if kind == "receiver stalled" else 1
            site.signal(target, signal.SIGSTOP)
            mend = partial(site.signal, target, signal.SIGCONT)
        case "connections reset":
            site.tell_wire("reset")
            lasts_s, mend = 0.0, partial(site.tell_wire, "delay_s", 0.0)
        case _:
            command, value = WIRE_FAULTS[kind]
            site.tell_wire(command, value)
            mend = partial(site.tell_wire, command, 0.0)
    return Fault(kind, target, lasts_s, mend)
