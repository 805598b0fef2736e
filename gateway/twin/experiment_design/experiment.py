"""An experiment as data and in words: one or two recordings, each with what the operator does; and those that a plan compares."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.twin.effects.housing import HousingSpin
from gateway.twin.effects.parameter import Value
from gateway.twin.effects.rope import Hoisting
from gateway.twin.model import TwinRig

INPUTS = (HousingSpin.name, Hoisting.name)
"""Effects that an operator can bring about."""
MIN_POSITION_CHANGE = 0.15
"""Smallest change of the housing's position that is worth an experiment, over the length of the rope."""
CLEARANCE = 1.1
"""Smallest distance of the housing from the pivot before hoisting, over the height by which it is hoisted."""
DRIVE_START_SHARE = 1 / 3
"""Share of a recording before the hoist starts. Basis: a free swing."""
MIN_DRIVE_S = 20.0
"""Shortest time in which an operator hoists."""
MAX_DRIVE_M_S = 1.0
"""Highest speed of hoisting."""
EFFORTS_S = {"turn": 60.0, "hoist": 120.0, "clamp": 600.0, "large swing": 120.0, "round swing": 180.0}
"""Manual efforts as waiting time in s. Basis: a choice, to rank experiments that separate alike: a large swing needs some drives
in step, a round one two that are a quarter of a period apart; to clamp the housing again a person climbs or lowers the hook."""
NEXT_RECORDING_EFFORT_S = 60.0
"""The same for another recording. Basis: a choice; the wait until the load hangs calm."""
LARGE_SWING_DEG, ROUND_SWING_AXIS_RATIO = 8.0, 0.5
"""Amplitude and axis ratio above which a swing needs an effort. Basis: a choice; a hand starts a smaller one."""
TURN_DEG_S = 3.0
"""Rotation of the housing. Basis: one turn in the two minutes of a recording, 0.05 rad/s."""
AT_REST_DEG = 0.3
"""Amplitude of a load that hangs still."""


@dataclass(frozen=True, slots=True)
class Run:
    """One recording."""

    amplitude_deg: float = 5.0
    axis_ratio: float = 0.2
    """Smaller over larger axis of the swing's ellipse: 0 for a planar swing, 1 for a circle."""
    duration_s: float = 120.0
    turn_deg_s: float = 0.0
    """Rate at which the operator turns the housing about the rope."""
    heading_deg: float = 0.0
    """Angle about the rope by which the housing is clamped against the first recording."""
    hoist_share: float = 0.0
    """Height by which the load is hoisted, over the nominal length; negative for lowering."""
    position_share: float | None = None
    """Distance of the housing from the pivot over the nominal length, if it is clamped elsewhere."""

    def position_change_m(self, rig: TwinRig) -> float:
        """Return the change of the housing's distance from the pivot against the nominal one."""
        return 0.0 if self.position_share is None else self.position_share * rig.length_m - rig.position_m

    def is_possible(self, rig: TwinRig) -> bool:
        """Return whether the housing stays on the rope, and another position differs enough."""
        change_m = self.position_change_m(rig)
        is_elsewhere = self.position_share is None or abs(change_m) > MIN_POSITION_CHANGE * rig.length_m
        return is_elsewhere and rig.position_m + change_m >= CLEARANCE * self.hoist_share * rig.length_m

    def inputs(self, rig: TwinRig) -> dict[str, Mapping[str, Value]]:
        """Return what the operator does, as effects with known parameters."""
        known: dict[str, Mapping[str, Value]] = {}
        if self.turn_deg_s:
            known[HousingSpin.name] = {"rate_deg_s": self.turn_deg_s}
        if self.hoist_share:
            drive_s = self.drive_s(rig)
            speed_m_s = -self.hoist_share * rig.length_m / drive_s
            known[Hoisting.name] = {
                "speed_m_s": speed_m_s,
                "start_s": self.duration_s * DRIVE_START_SHARE,
                "duration_s": drive_s,
            }
        return known

    def drive_s(self, rig: TwinRig) -> float:
        """Return the duration of hoisting."""
        return max(MIN_DRIVE_S, abs(self.hoist_share) * rig.length_m / MAX_DRIVE_M_S)

    @property
    def actions(self) -> set[str]:
        """What costs an effort, by the names of `EFFORTS_S`."""
        is_done = {
            "turn": self.turn_deg_s,
            "hoist": self.hoist_share,
            "clamp": self.heading_deg or self.position_share is not None,
            "large swing": self.amplitude_deg > LARGE_SWING_DEG,
            "round swing": self.axis_ratio > ROUND_SWING_AXIS_RATIO,
        }
        return {action for action, done in is_done.items() if done}

    def describe(self, rig: TwinRig) -> str:
        """Return what the operator does, in the order of the actions."""
        clauses = []
        if self.heading_deg:
            clauses.append(f"clamp the housing again, turned by {self.heading_deg:.0f}° about the rope")
        if self.position_share is not None:
            below_m = self.position_share * rig.length_m
            clauses.append(f"clamp the housing {below_m:.2f} m below the pivot, with the same side facing the same way")
        shape = "nearly in a circle" if self.axis_ratio > ROUND_SWING_AXIS_RATIO else "freely"
        swings = self.amplitude_deg > AT_REST_DEG
        clauses.append(f"let it swing {shape} from {self.amplitude_deg:.0f}°" if swings else "let the load hang still")
        if self.turn_deg_s:
            turn_s = 360 / self.turn_deg_s
            clauses.append(f"meanwhile turn the housing evenly about the rope, one turn in {turn_s:.0f} s")
        if self.hoist_share:
            verb, height_m = "hoist" if self.hoist_share > 0 else "lower", abs(self.hoist_share) * rig.length_m
            drive_s, start_s = self.drive_s(rig), self.duration_s * DRIVE_START_SHARE
            clauses.append(f"{verb} by {height_m:.1f} m within {drive_s:.0f} s, starting at {start_s:.0f} s")
        return f"{', '.join(clauses)}; record {self.duration_s:.0f} s"


@dataclass(frozen=True, slots=True)
class Experiment:
    """One recording, or several in succession."""

    runs: tuple[Run, ...]

    @property
    def duration_s(self) -> float:
        """Duration of all recordings."""
        return sum(run.duration_s for run in self.runs)

    @property
    def effort_s(self) -> float:
        """Duration and manual effort of all recordings."""
        manual_s = sum(EFFORTS_S[action] for run in self.runs for action in run.actions)
        return self.duration_s + manual_s + NEXT_RECORDING_EFFORT_S * (len(self.runs) - 1)

    def is_possible(self, rig: TwinRig) -> bool:
        """Return whether all recordings are possible on this rig."""
        return all(run.is_possible(rig) for run in self.runs)

    def is_extension_of(self, other: "Experiment") -> bool:
        """Return whether the operator does the same as in another experiment, and more."""
        return self._actions() > other._actions()

    def _actions(self) -> set[str]:
        handled = {action for run in self.runs for action in run.actions if not action.endswith("swing")}
        return handled | ({"repeat"} if len(self.runs) > 1 else set())

    def inputs(self, rig: TwinRig) -> set[str]:
        """Return the names of the effects that the operator brings about."""
        return {name for run in self.runs for name in run.inputs(rig)}

    def describe(self, rig: TwinRig) -> str:
        """Return what to do in one recording, or in two."""
        first, *others = (run.describe(rig) for run in self.runs)
        return f"two recordings in succession, in the same wind: first {first}; then {others[0]}" if others else first

    @property
    def time_needed(self) -> str:
        """The time of recording and the total time."""
        return f"{self.duration_s / 60:.0f} min of recording, about {self.effort_s / 60:.0f} min in all"


FREE_SWING = Experiment((Run(),))
"""An ordinary recording, in which the operator does nothing to separate effects."""

CANDIDATES: tuple[Experiment, ...] = (
    FREE_SWING,
    # a swing that is longer, larger or rounder
    Experiment((Run(duration_s=300.0),)),
    Experiment((Run(amplitude_deg=10.0),)),
    Experiment((Run(amplitude_deg=10.0, duration_s=300.0),)),
    Experiment((Run(axis_ratio=0.9),)),
    Experiment((Run(amplitude_deg=10.0, axis_ratio=0.9),)),
    # rotation of the housing about the rope
    Experiment((Run(amplitude_deg=AT_REST_DEG, turn_deg_s=TURN_DEG_S),)),
    Experiment((Run(turn_deg_s=TURN_DEG_S),)),
    Experiment((Run(amplitude_deg=10.0, turn_deg_s=TURN_DEG_S),)),
    # hoisting and lowering
    Experiment((Run(amplitude_deg=10.0, hoist_share=1 / 3),)),
    Experiment((Run(amplitude_deg=10.0, duration_s=300.0, hoist_share=1 / 3),)),
    Experiment((Run(amplitude_deg=10.0, duration_s=300.0, hoist_share=-1 / 3),)),
    Experiment((Run(amplitude_deg=10.0, turn_deg_s=TURN_DEG_S, hoist_share=1 / 3),)),
    # two recordings
    Experiment((Run(), Run(amplitude_deg=10.0))),
    Experiment((Run(), Run(heading_deg=90.0))),
    Experiment((Run(amplitude_deg=10.0), Run(amplitude_deg=10.0, position_share=0.2))),
    Experiment((Run(amplitude_deg=10.0), Run(amplitude_deg=10.0, position_share=0.6))),
)
