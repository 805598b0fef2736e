"""A manoeuvre as data: one or two recordings, each with what the operator does during it."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.twin.effects.parameter import Value
from gateway.twin.model import TwinRig

INPUTS = ("housing_spin", "hoisting")
"""What an operator can bring about, as effects."""
ELSEWHERE = 0.15
"""Share of the rope by which another place differs."""
CLEARANCE = 1.1
"""A housing is that much further from the pivot than it is hoisted."""
DRIVE_FROM = 1 / 3
"""Share of a recording that is left to the free swing before the hoist moves."""
SLOWEST_DRIVE_S, FASTEST_M_S = 20.0, 1.0
TURNING_S, HOISTING_S, WIDE_SWING_S, ROUND_SWING_S, NEXT_RECORDING_S, CLAMPING_S = (
    60.0,
    120.0,
    120.0,
    180.0,
    60.0,
    600.0,
)
"""What handwork costs, in seconds of plain waiting: judgement, to rank manoeuvres that separate alike. A round swing wants two
drives, a quarter of a swing apart."""
WIDE_FROM_DEG, ROUND_FROM = 8.0, 0.5


@dataclass(frozen=True, slots=True)
class Run:
    """One recording."""

    amplitude_deg: float = 5.0
    roundness: float = 0.2
    """Smaller over larger axis of the swing's ellipse: 0 to and fro, 1 round."""
    duration_s: float = 120.0
    turn_deg_s: float = 0.0
    """The housing is turned about the rope, evenly."""
    heading_deg: float = 0.0
    """The housing is clamped on, turned about the rope against the first recording."""
    hoist_share: float = 0.0
    """Of the believed length, hoisted during the recording; negative is lowered."""
    place_share: float | None = None
    """Another place of the housing: its distance from the pivot as a share of the believed length."""

    def moved_m(self, rig: TwinRig) -> float:
        """By how much the housing is further from the pivot than believed at first."""
        return 0.0 if self.place_share is None else self.place_share * rig.length_m - rig.position_m

    def possible(self, rig: TwinRig) -> bool:
        """The housing stays on the rope, and another place is another place."""
        moved_m = self.moved_m(rig)
        elsewhere = self.place_share is None or abs(moved_m) > ELSEWHERE * rig.length_m
        return elsewhere and rig.position_m + moved_m >= CLEARANCE * self.hoist_share * rig.length_m

    def inputs(self, rig: TwinRig) -> dict[str, Mapping[str, Value]]:
        """What the operator does, as effects with known parameters."""
        known: dict[str, Mapping[str, Value]] = {}
        if self.turn_deg_s:
            known["housing_spin"] = {"rate_deg_s": self.turn_deg_s}
        if self.hoist_share:
            drive_s = self.drive_s(rig)
            speed_m_s = -self.hoist_share * rig.length_m / drive_s
            known["hoisting"] = {
                "speed_m_s": speed_m_s,
                "start_s": self.duration_s * DRIVE_FROM,
                "duration_s": drive_s,
            }
        return known

    def drive_s(self, rig: TwinRig) -> float:
        """How long the hoist moves."""
        return max(SLOWEST_DRIVE_S, abs(self.hoist_share) * rig.length_m / FASTEST_M_S)

    @property
    def manual_effort_s(self) -> float:
        """Beside the recording's own duration."""
        return (
            TURNING_S * bool(self.turn_deg_s)
            + HOISTING_S * bool(self.hoist_share)
            + WIDE_SWING_S * (self.amplitude_deg > WIDE_FROM_DEG)
            + ROUND_SWING_S * (self.roundness > ROUND_FROM)
            + CLAMPING_S * bool(self.heading_deg or self.place_share is not None)
        )


@dataclass(frozen=True, slots=True)
class Experiment:
    """One recording, or several right after one another."""

    legs: tuple[Run, ...]

    @property
    def duration_s(self) -> float:
        """Of all recordings."""
        return sum(leg.duration_s for leg in self.legs)

    @property
    def effort_s(self) -> float:
        """Recordings and handwork."""
        return self.duration_s + sum(leg.manual_effort_s for leg in self.legs) + NEXT_RECORDING_S * (len(self.legs) - 1)

    def possible(self, rig: TwinRig) -> bool:
        """On this rig."""
        return all(leg.possible(rig) for leg in self.legs)

    def is_extension_of(self, other: "Experiment") -> bool:
        """The same work, and more."""
        return self._works() > other._works()

    def _works(self) -> set[str]:
        turned, hoisted = any(leg.turn_deg_s for leg in self.legs), any(leg.hoist_share for leg in self.legs)
        clamped = any(leg.heading_deg or leg.place_share is not None for leg in self.legs)
        works = {"turning": turned, "hoisting": hoisted, "clamping": clamped, "repeating": len(self.legs) > 1}
        return {work for work, done in works.items() if done}

    def inputs(self, rig: TwinRig) -> set[str]:
        """Names of the effects that the operator brings about himself."""
        return {name for leg in self.legs for name in leg.inputs(rig)}
