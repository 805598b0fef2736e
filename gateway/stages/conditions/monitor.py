"""Whether a reading can be trusted: named gates on the last seconds (001 section 3).

The norm gate (001 eq. 15) is necessary and not sufficient: constant accelerations exist that leave |m| = 1 (001 Fig. 2), and
no accelerometer alone can see them. The gates on stillness, impact and pendulum consistency narrow what it lets through.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.messages import Cause, Verdict
from gateway.stages.conditions.gyro_gates import turning_gates
from gateway.stages.conditions.window import Bin, ConditionWindow
from gateway.stages.conditions.window_features import SMOOTHED_BINS, WindowFeatures, smoothed

Array = NDArray[np.float64]
FEWEST_BINS = 10
STEADY_BINS = 40
"""While nobody knows whether it swings: a load near its turning point looks still for less long than this."""
ROUGHEST_G = 0.1
"""Vibration beyond which the mean is not believed."""
IMPACT_G = 0.05
"""A single sample this far from its bin's mean is an impact,"""
CREST = 8.0
"""unless vibration scatters as much: this many times what is usual in the window."""
LOST_SHARE = 0.1
WIDEST_RAD = np.radians(30.0)
"""While the swing is not known yet, a hanging load is given as much as this."""
ENERGY_FLOOR_G, ENERGY_SHARE, ENERGY_SIGMA = 0.001, 0.1, 5.0
"""By how much the amplitude, from place and rate at each instant, may change within the window of a free swing."""
AXIAL_FLOOR_G, AXIAL_SHARE = 0.0015, 0.3
"""By how much the force along the rope may depart from what the place in the swing asks for."""
LARGEST_SEEN_RHO = 0.9
"""Nearer to the load the transverse force says too little of the place in the swing."""


@dataclass(frozen=True, slots=True)
class SwingContext:
    """What the swing stage says of the same stretch."""

    swinging: bool | None
    phi_max_rad: float | None
    consistent: bool
    """A pendulum explains the motion."""
    rho: float | None = None
    """Where on the rope the housing hangs, by the period; None: as far down as it can be."""
    period_s: float | None = None
    lean_g: tuple[float, float] = (0.0, 0.0)
    """Transverse force about which the swing goes."""
    hoisting: bool = False
    """The rope's length surely changes; the pendulum that explains the motion has it in."""


@dataclass(frozen=True, slots=True)
class ConditionResult:
    """The verdict with its gates."""

    verdict: Verdict
    cause: Cause | None
    trusted: bool
    reasons: tuple[str, ...]
    gates: dict[str, bool]
    norm_g: float | None


class ConditionMonitor:
    """Keeps the last seconds and judges them."""

    def __init__(self, noise_g: float | None, permissible_norm_error_g: float) -> None:
        self._noise_g = noise_g
        self._dm_g = permissible_norm_error_g
        self._window = ConditionWindow()

    def update(
        self, time_s: Array, force_g: Array, clipped: int, missing: int, rate_rad_s: Array | None = None
    ) -> None:
        """Take a block: times (n,), specific force (n, 3), how many samples were clipped or are missing, angular rates (n, 3)."""
        self._window.update(time_s, force_g, clipped, missing, rate_rad_s)

    def judge(self, swing: SwingContext) -> ConditionResult:
        """The verdict on the window."""
        bins = self._window.bins
        if len(bins) < FEWEST_BINS:
            return ConditionResult(
                "unknown", None, False, ("less than a second of data",), {"enough_data": False}, None
            )
        look = WindowFeatures.at(bins, self._noise_g)
        means = look.means_g
        gates = {"enough_data": True} | _sample_gates(look) | self._motion_gates(look, swing) | _turning(bins, swing)
        verdict, cause, reasons = _verdict(gates, swing, means)
        trusted = verdict in ("static", "quasi_static", "swinging")
        return ConditionResult(verdict, cause, trusted, reasons, gates, float(np.linalg.norm(means.mean(axis=0))))

    def _motion_gates(self, look: WindowFeatures, swing: SwingContext) -> dict[str, bool]:
        """On what the bins' means do."""
        norms = np.linalg.norm(look.smoothed_g, axis=1)
        memory = self._window.memory
        impact_g = _impact_g(look)
        calm = [b for b in memory if not b.clipped and b.peak_g < impact_g]
        enough = swing.swinging is False or len(memory) >= STEADY_BINS
        widest_rad = WIDEST_RAD if swing.phi_max_rad is None else swing.phi_max_rad
        span = 1 - np.cos(widest_rad)
        rho = 1.0 if swing.rho is None else swing.rho
        free = bool(swing.swinging) and swing.consistent and not swing.hoisting
        return {
            "still": look.still,
            "steady": enough and len(calm) >= FEWEST_BINS and WindowFeatures.at(calm, self._noise_g).still,
            "norm_static": bool(np.all(np.abs(norms - 1) < self._dm_g)),
            "norm_pendulum": bool(
                np.all(norms > 1 - span - self._dm_g) and np.all(norms < 1 + 2 * rho * span + self._dm_g)
            ),
            "energy": not free or _energy_gate(look.bins, look.means_g, swing),
            "axial": not free or _is_free_pendulum(look.means_g, swing),
            "rope_keeps_length": not swing.hoisting or look.still,
            "pendulum": free,
        }


def _sample_gates(look: WindowFeatures) -> dict[str, bool]:
    """On the samples within the bins."""
    bins = look.bins
    return {
        "complete": sum(b.missing for b in bins) <= LOST_SHARE * sum(b.count for b in bins),
        "not_clipped": not any(b.clipped for b in bins),
        "no_impact": max(b.peak_g for b in bins) < _impact_g(look),
        "axes_alive": bool(np.all(np.abs(look.means_g).max(axis=0) > 0)),
        "quiet": not look.rough,
        "not_shaken": look.scatter_g < ROUGHEST_G,
    }


def _impact_g(look: WindowFeatures) -> float:
    return max(IMPACT_G, CREST * look.scatter_g) + 6 * look.noise_g


def _turning(bins: list[Bin], swing: SwingContext) -> dict[str, bool]:
    """On the angular rates; no gates where there are none."""
    rates = [b.rate_rad_s for b in bins if b.rate_rad_s is not None]
    return turning_gates(np.array(rates), swing.phi_max_rad, swing.period_s) if rates else {}


def _energy_gate(bins: list[Bin], means: Array, swing: SwingContext) -> bool:
    """A free swing's amplitude, sqrt(f^2 + (f'/w)^2), is the same at every instant, planar or not."""
    if swing.period_s is None:
        return True
    spacing_s = (bins[-1].time_s - bins[0].time_s) / (len(bins) - 1)
    half = SMOOTHED_BINS // 2
    lags = np.arange(-half, half + 1)
    across = means[:, :2] - swing.lean_g
    n = len(across) - 2 * half
    rate = sum(lag * across[half + lag : half + lag + n] for lag in lags) / (spacing_s * (lags**2).sum())
    place = smoothed(means, SMOOTHED_BINS)[:, :2] - swing.lean_g
    radian_s = swing.period_s / (2 * np.pi)
    amplitude_g = np.sqrt((place**2 + (rate * radian_s) ** 2).sum(axis=1))
    u_mean_g = min(b.scatter_g for b in bins) / np.sqrt(np.mean([b.count for b in bins]))
    u_rate_g = radian_s * u_mean_g / (spacing_s * np.sqrt((lags**2).sum()))
    return bool(np.ptp(amplitude_g) < ENERGY_FLOOR_G + ENERGY_SHARE * amplitude_g.max() + ENERGY_SIGMA * u_rate_g)


def _is_free_pendulum(means: Array, swing: SwingContext) -> bool:
    """The force along the rope follows the place in the swing: f_z = const - (1/2 + rho) phi^2, phi = f_t/(1 - rho)."""
    if swing.rho is None or swing.rho > LARGEST_SEEN_RHO:
        return True
    place_g = smoothed(means, SMOOTHED_BINS)
    square = ((place_g[:, :2] - swing.lean_g) ** 2).sum(axis=1) / (1 - swing.rho) ** 2
    expected_g = -(0.5 + swing.rho) * square
    return bool(np.ptp(place_g[:, 2] - expected_g) < AXIAL_FLOOR_G + AXIAL_SHARE * np.ptp(expected_g))


UNUSABLE = {
    "complete": "more than a tenth of the samples is missing",
    "axes_alive": "an axis reads exactly zero",
}
DISTURBING: dict[str, tuple[Cause | None, str]] = {
    "not_clipped": ("clipped", "clipped: a reading reached full scale"),
    "no_impact": ("impact", "impact: a sample far off its neighbours"),
    "not_shaken": ("vibration", "vibration: too strong for the mean to be believed"),
    "rope_keeps_length": ("hoisting", "hoisting: the rope's length changes"),
    "norm_pendulum": (None, "the magnitude is not that of a hanging load"),
    "energy": ("trolley", "trolley: the swing gains or loses faster than a free one"),
    "axial": ("hoisting", "hoisting: the force along the rope is not that of a free swing"),
    "no_spin": (None, "the housing turns about the rope"),
    "rate_pendulum": (None, "the housing turns faster than the rope swings"),
}


def _verdict(
    gates: dict[str, bool], swing: SwingContext, means: Array
) -> tuple[Verdict, Cause | None, tuple[str, ...]]:
    """From gates to verdict and cause; the reasons name the gates that decided."""
    if unusable := tuple(text for gate, text in UNUSABLE.items() if not gates[gate]):
        return "unknown", None, unusable
    if disturbed := [said for gate, said in DISTURBING.items() if not gates.get(gate, True)]:
        cause = next((cause for cause, _ in disturbed if cause is not None), None)
        if cause is None and not gates["still"]:
            cause = _infer_cause(means, swing)
        return "disturbed", cause, tuple(text for _, text in disturbed)
    if gates["pendulum"]:
        return "swinging", None, ("moves as a pendulum does",)
    return _without_swing(gates, swing, means)


def _without_swing(
    gates: dict[str, bool], swing: SwingContext, means: Array
) -> tuple[Verdict, Cause | None, tuple[str, ...]]:
    if gates["still"] and gates["norm_static"]:
        if not gates["steady"]:
            return "unknown", None, ("still for a moment, which a swing is at its turning point",)
        return _at_rest(gates)
    if swing.swinging is None:
        return "unknown", None, ("moving; not yet a full swing to judge by",)
    if gates["still"]:
        return "disturbed", None, ("still, but the magnitude is not 1 g",)
    cause = _infer_cause(means, swing)
    return "disturbed", cause, (f"{cause}: moves as no pendulum does",)


def _at_rest(gates: dict[str, bool]) -> tuple[Verdict, Cause | None, tuple[str, ...]]:
    if not gates.get("not_turning", True):
        return "disturbed", None, ("still by its forces, but the housing turns",)
    if gates["quiet"]:
        return "static", None, ("still, and the magnitude is 1 g",)
    return "quasi_static", "vibration", ("vibration about a steady mean of 1 g",)


def _infer_cause(means: Array, swing: SwingContext) -> Cause:
    """What drives: a hoist shows along the rope, trolley and wind across it."""
    moved_g = np.ptp(smoothed(means, SMOOTHED_BINS), axis=0)
    return "hoisting" if moved_g[2] > np.hypot(moved_g[0], moved_g[1]) else "trolley"
