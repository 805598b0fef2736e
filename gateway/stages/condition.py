"""The condition of a reading: the gates, which are named tests of the last seconds, and the verdict (Łuczak n.d., section 3).

The verdict says whether the reading can be trusted; the rope's motion decides with the gates, which are true where passed. The
norm gate (Łuczak n.d., eq. 15) is necessary and not sufficient: there are constant accelerations that leave |m| = 1 (Łuczak n.d.,
Fig. 2), and no accelerometer can detect them. The gates on stillness and impact, and the evidence of the motion filter, exclude
most other motions that it lets pass.
"""

from dataclasses import dataclass

import numpy as np

from gateway.messages import Cause, MotionState, Verdict
from gateway.messages.header import Reason, ReasonCode
from gateway.numerics.array import Array
from gateway.stages.condition_window import STILL_FLOOR_G, Bin, ConditionWindow, WindowFeatures

ZERO_RATE_RAD_S = np.radians(2.0)
"""Largest reading of a usual gyroscope at rest. Basis: a choice; zero-rate outputs are compensated at rest, and a hand turns a
housing faster."""
RATE_MARGIN = 1.2
"""The housing may turn this many times faster than the rope at its fastest. Basis: a choice; the amplitude is an upper 95 % end,
and the rope's length is stated within some per cent."""
MIN_VERDICT_BINS = 10
"""Bins without which there is no verdict. Basis: a choice; a second, half of the window."""
STEADY_BINS = 40
"""While it is not known whether the load swings, "steady" needs this many bins: a swing is still near its turning point. Basis: a
choice; four seconds, in which a rope of up to 16 m makes half a swing."""
ROUGHEST_G = 0.1
"""Largest vibration with a reliable mean. Basis: a choice; a mean of a hundred independent samples errs by 10 mg at it, 0.6
degrees."""
IMPACT_G = 0.05
"""Smallest distance of a sample from the mean of its bin that is an impact. Basis: a choice; far above the noise of any sensor,
and below what a knock on a load gives."""
MIN_IMPACT_CREST = 8.0
"""The distance of an impact also exceeds this many times the usual scatter of the window, or vibration would be one. Basis: a
choice; vibration has crests of 3 to 4, and impacts have more."""
LOST_SHARE = 0.1
"""Share of lost samples up to which a window is complete. Basis: a choice; single losses do not matter, and a gap of a bin
shows."""
MAX_UNKNOWN_SWING_RAD = np.radians(30.0)
"""Largest swing of a hanging load while the swing is not known. Basis: a choice; a crane swings its load by less, and a sensor
off its rope leans by more."""
MAX_DRIVE_G = 0.1
"""Largest contribution of a drive or a hoist to the magnitude of the force; also after it, while the window holds it. Basis: a
choice; a hoist that reaches 0.5 m/s in one second adds 0.05 g."""
MAX_TRUSTED_U_RAD = np.radians(1.5)
"""Largest standard uncertainty of an angle that can be trusted. Basis: a choice; with an interval of 3 degrees on either side an
angle says no more."""
DRIVEN_STATES: tuple[MotionState, ...] = ("driven", "hoisting", "wind")
"""States in which something acts on crane or load."""
Decision = tuple[Verdict, Cause | None, tuple[Reason, ...]]
"""Verdict, cause and reasons."""
UNUSABLE: dict[ReasonCode, str] = {
    "complete": "more than a tenth of the samples is missing",
    "axes_alive": "an axis reads exactly zero",
}
"""Gates without which nothing is known, and the reason, which has the name of its gate as code."""
DISTURBING: dict[ReasonCode, tuple[Cause | None, str]] = {
    "not_clipped": ("clipped", "clipped: a reading reached full scale"),
    "no_impact": ("impact", "impact: a sample far from its neighbours"),
    "not_shaken": ("vibration", "vibration: too strong for a reliable mean"),
    "norm_hanging": (None, "the magnitude of the force is not that of a hanging load"),
    "explained": (None, "no motion of crane and load explains the readings"),
    "no_spin": (None, "the housing turns about the rope"),
    "rate_pendulum": (None, "the housing turns faster than the rope swings"),
}
"""Gates without which a reading is disturbed, with cause and reason."""
CAUSES: dict[MotionState, Cause] = {"driven": "trolley", "hoisting": "hoisting", "wind": "wind"}
TOO_SHORT = (Reason("too_short", "less than a second of data"),)
SWINGING: dict[MotionState, Reason] = {
    "free": Reason("free_pendulum", "moves as a free pendulum"),
    "rest": Reason("small_swing", "moves, but by no more than what counts as rest"),
}
"""The reason of this verdict by the state of the motion."""
UNCERTAIN_CAUSE = Reason("free_pendulum", "swings, and nothing else acts for certain")
TURNING_POINT = Reason("turning_point", "at rest for too short a time: the load may be at the turning point of a swing")
NOT_WELL_KNOWN = Reason("undetermined", "moving, and the angle is not known well enough")
TRUSTED_VERDICTS: tuple[Verdict, ...] = ("static", "quasi_static", "swinging", "driven")


def turning_gates(rate_rad_s: Array, phi_max_rad: float | None, period_s: float | None) -> dict[str, bool]:
    """Return the gates on mean angular rates in the housing frame, shape (n, 3), of one window; true: passed.

    They show rotations of the housing that no force shows. A load at rest does not rotate. In a free swing the housing rotates
    transversely to the rope no faster than the rope does, |n'| <= w0 phi_max at the lowest point, and not at all about the
    rope, because of parallel transport. `phi_max_rad` and `period_s` are those of the swing, None where no swing is known.
    """
    across_rad_s = float(np.hypot(rate_rad_s[:, 0], rate_rad_s[:, 1]).max())
    along_rad_s = float(np.abs(rate_rad_s[:, 2]).max())
    gates = {
        "not_turning": max(across_rad_s, along_rad_s) < ZERO_RATE_RAD_S,
        "no_spin": along_rad_s < ZERO_RATE_RAD_S,
    }
    if phi_max_rad is not None and period_s is not None:
        fastest_rad_s = 2 * np.pi / period_s * phi_max_rad
        gates["rate_pendulum"] = across_rad_s < RATE_MARGIN * fastest_rad_s + ZERO_RATE_RAD_S
    return gates


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionContext:
    """The rope's motion in the same seconds."""

    state: MotionState
    u_rad: float | None = None
    """Standard uncertainty of the rope's angle; None: the angle is not known."""
    phi_max_rad: float | None = None
    """Upper 95 % end of the largest angle of the last period."""
    amplitude_rad: float | None = None
    """Amplitude of the swing about the lean."""
    period_s: float | None = None
    rho: float | None = None
    """Position of the housing on the rope; None: as near to the load as possible."""
    is_explained: bool = True
    """The motion explains the readings."""
    is_cause_distinct: bool = True
    """What acts by the state is distinguishable from nothing."""
    reasons: tuple[Reason, ...] = ()
    """What acts, or why the angle is not known."""

    @property
    def is_known(self) -> bool:
        """The angle is known well enough to be trusted."""
        return self.u_rad is not None and bool(self.u_rad < MAX_TRUSTED_U_RAD)

    @property
    def is_below_stillness(self) -> bool:
        """The swing is too small to move the reading of a still housing."""
        rho = 1.0 if self.rho is None else self.rho
        return self.is_known and self.amplitude_rad is not None and (1 - rho) * self.amplitude_rad < STILL_FLOOR_G

    @property
    def is_driven(self) -> bool:
        """Something acts on crane or load, and its size is distinguishable from zero."""
        return self.state in DRIVEN_STATES and self.is_cause_distinct


def evaluate_gates(
    features: WindowFeatures,
    window: ConditionWindow,
    motion: MotionContext,
    noise_g: float | None,
    permissible_norm_error_g: float,
) -> dict[str, bool]:
    """Return all gates of the window; `noise_g` is None where the device does not state it."""
    return {
        "enough_data": True,
        **_sample_gates(features),
        **_motion_gates(features, window.memory, motion, noise_g, permissible_norm_error_g),
        **_rotation_gates(features.bins, motion),
    }


def _sample_gates(features: WindowFeatures) -> dict[str, bool]:
    """Return the gates on the samples within the bins."""
    bins = features.bins
    return {
        "complete": sum(b.missing for b in bins) <= LOST_SHARE * sum(b.count for b in bins),
        "not_clipped": not any(b.clipped for b in bins),
        "no_impact": max(b.peak_g for b in bins) < _impact_g(features),
        "axes_alive": bool(np.all(np.abs(features.means_g).max(axis=0) > 0)),
        "quiet": not features.rough,
        "not_shaken": features.scatter_g < ROUGHEST_G,
    }


def _motion_gates(
    features: WindowFeatures,
    memory: list[Bin],
    motion: MotionContext,
    noise_g: float | None,
    permissible_norm_error_g: float,
) -> dict[str, bool]:
    """Return the gates on the means of the bins."""
    norms = np.linalg.norm(features.smoothed_g, axis=1)
    impact_g = _impact_g(features)
    calm = [b for b in memory if not b.clipped and b.peak_g < impact_g]
    enough = motion.state == "rest" or len(memory) >= STEADY_BINS
    lowest_g, highest_g = _norm_limits_g(motion, permissible_norm_error_g)
    return {
        "still": features.still,
        "steady": enough and len(calm) >= MIN_VERDICT_BINS and WindowFeatures.at(calm, noise_g).still,
        "norm_static": bool(np.all(np.abs(norms - 1) < permissible_norm_error_g)),  # eq. 9-15
        "norm_hanging": bool(np.all(norms > lowest_g) and np.all(norms < highest_g)),
        "explained": motion.is_explained,
        "angle_known": motion.is_known,
        "not_driven": not motion.is_driven,
    }


def _norm_limits_g(motion: MotionContext, permissible_norm_error_g: float) -> tuple[float, float]:
    """Return the limits of the magnitude of the force on a hanging load."""
    widest_rad = MAX_UNKNOWN_SWING_RAD if motion.phi_max_rad is None else motion.phi_max_rad
    span = 1 - np.cos(widest_rad)
    margin_g = permissible_norm_error_g + MAX_DRIVE_G
    rho = 1.0 if motion.rho is None else motion.rho
    return 1 - span - margin_g, 1 + 2 * rho * span + margin_g


def _rotation_gates(bins: list[Bin], motion: MotionContext) -> dict[str, bool]:
    """Return the gates on the angular rates; none without a gyroscope."""
    rates = [b.rate_rad_s for b in bins if b.rate_rad_s is not None]
    if not rates:
        return {}
    free = motion.state not in DRIVEN_STATES
    return turning_gates(np.array(rates), motion.phi_max_rad if free else None, motion.period_s if free else None)


def _impact_g(features: WindowFeatures) -> float:
    return max(IMPACT_G, MIN_IMPACT_CREST * features.scatter_g) + 6 * features.noise_g


@dataclass(frozen=True, slots=True)
class ConditionResult:
    """The verdict with its gates."""

    verdict: Verdict
    cause: Cause | None
    trusted: bool
    reasons: tuple[Reason, ...]
    gates: dict[str, bool]
    norm_g: float | None


def judge_condition(
    window: ConditionWindow, motion: MotionContext, noise_g: float | None, permissible_norm_error_g: float
) -> ConditionResult:
    """Judge the window; `noise_g` is that of the device, None where it is not known."""
    bins = window.bins
    if len(bins) < MIN_VERDICT_BINS:
        return ConditionResult("unknown", None, False, TOO_SHORT, {"enough_data": False}, None)
    features = WindowFeatures.at(bins, noise_g)
    gates = evaluate_gates(features, window, motion, noise_g, permissible_norm_error_g)
    verdict, cause, reasons = _decide(gates, motion)
    norm_g = float(np.linalg.norm(features.means_g.mean(axis=0)))
    return ConditionResult(verdict, cause, verdict in TRUSTED_VERDICTS, reasons, gates, norm_g)


def _decide(gates: dict[str, bool], motion: MotionContext) -> Decision:
    """Return verdict and cause; the reasons name what decided."""
    if unusable := tuple(Reason(gate, words) for gate, words in UNUSABLE.items() if not gates[gate]):
        return "unknown", None, unusable
    if disturbed := [(gate, *entry) for gate, entry in DISTURBING.items() if not gates.get(gate, True)]:
        cause = next((cause for _, cause, _ in disturbed if cause is not None), None)
        return "disturbed", cause, tuple(Reason(gate, words) for gate, _, words in disturbed)
    at_rest = gates["still"] and (gates["steady"] or (motion.state == "rest" and motion.is_below_stillness))
    if at_rest and (not motion.is_known or motion.state != "free"):
        return _decide_at_rest(gates)
    return _decide_by_motion(motion) if motion.is_known else _decide_unknown(gates, motion)


def _decide_by_motion(motion: MotionContext) -> Decision:
    if motion.is_driven:
        return "driven", CAUSES[motion.state], motion.reasons
    return "swinging", None, (SWINGING.get(motion.state, UNCERTAIN_CAUSE), *motion.reasons)


def _decide_unknown(gates: dict[str, bool], motion: MotionContext) -> Decision:
    if gates["still"] and gates["norm_static"]:
        return "unknown", None, (TURNING_POINT,)
    return "unknown", None, motion.reasons or (NOT_WELL_KNOWN,)


def _decide_at_rest(gates: dict[str, bool]) -> Decision:
    if not gates["norm_static"]:
        return "disturbed", None, (Reason("norm_static", "still, but the magnitude is not 1 g"),)
    if not gates.get("not_turning", True):
        return "disturbed", None, (Reason("not_turning", "the forces are constant, but the housing turns"),)
    if gates["quiet"]:
        return "static", None, (Reason("still", "still, and the magnitude is 1 g"),)
    return "quasi_static", "vibration", (Reason("vibration", "vibration about a constant mean of 1 g"),)
