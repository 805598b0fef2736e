"""Where to start the fit of an effect: fits are not convex in times and frequencies, so those come from the data."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import find_machine_line, find_strongest_line, fit_sine_phasors
from gateway.twin.effects.effect import Value
from gateway.twin.effects.pulse import SHARPEST
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.changepoints.changepoint_scan import EventWindow
from gateway.twin.reconcile.data.artefact_detectors import WRITTEN_RESOLUTION_G
from gateway.twin.reconcile.data.observations import Observations

Array = NDArray[np.float64]
Values = dict[str, Value]
BOUNCE_HZ = (0.5, 8.0)
RIGGING_PARTS = (0.08, 0.13, 0.2, 0.27, 0.35, 0.45, 0.6)
FASTER = 1.01
APART = (1.5, 12.0)
"""Fast mode over slow mode of a hook block with weight; nearer lines are one swing that changes."""
LEAST_FAST = 0.05
"""Size of the fast mode's line over the slow one's: overtones of a swing that changes are fainter."""
SWINGS_HZ = (0.03, 2.0)
SWING_MIDDLE_HZ = 0.5
SLOWEST_TURN_DEG_S = 0.3
BOUNCING = 30.0
"""Power of a bounce over the floor around it: it dies away, so its line is broad and low."""
EVIDENT = 100.0
"""Power of a line over the floor around it."""
WIDER = 1.5
RAMPS, MIDDLING_RAMP = (0.2, 0.28, 0.36), 0.25
"""Share of a drive that is each of its ramps."""
SECOND_HZ = 0.4
"""Above the slow swing of a rope of 2 m or more."""
OVERTONES, TURNS_OFF = (2, 3, 4, 5), 3.0
"""Multiples of a line, and by how many turns in the recording one may be off: the line itself moves as it dies away."""
MUCH_STRONGER = 10.0
"""What is left of the main line over a line below its last overtone that is none of a machine's."""
HALF_RISING = 0.5
"""Between a gust that swells all the time and a pull with sharp edges."""
SHORT_S, APART_S = 1.5, 0.15
"""Of the time of a blow, what can be told from where motions part, and how near a fit must begin to find it."""
AT_LIMIT = 3
OFF_GRID_S = 0.013
"""So that no edge stands on a sample."""


@dataclass(frozen=True, slots=True)
class GuessContext:
    """What is known when an effect is to be tried."""

    rig: TwinRig
    observations: Observations
    residual_g: Array
    """Of the model so far, shape (n, 3)."""
    windows: tuple[EventWindow, ...]
    """Up to growing lengths, as `LENGTHS_S` has them."""
    changepoints: EventWindow | None = None
    """Where the motion before and the motion after were told apart; surer than the windows."""


def no_guess(_situation: GuessContext) -> list[Values]:
    """Neutral: the effect is linear there."""
    return [{}]


def guess_impact(situation: GuessContext) -> list[Values]:
    """Where the motions part, and in the middle of the short windows."""
    parted = situation.changepoints
    first: list[Values] = []
    if parted is not None and parted.to_s - parted.from_s < SHORT_S:
        at_s = np.arange(parted.from_s - SHORT_S / 2, parted.to_s, APART_S) + OFF_GRID_S
        nearest = np.argsort(np.abs(at_s - parted.from_s), kind="stable")
        first = [{"start_s": float(each)} for each in at_s[nearest]]
    return first + [{"start_s": (w.from_s + w.to_s) / 2 + OFF_GRID_S} for w in situation.windows[:2]]


def guess_gust(situation: GuessContext) -> list[Values]:
    """Between the motions; and about the windows' middles, longer: a gust swells and dies away."""
    found = [_pulse_in(w, WIDER) for w in situation.windows[1:3]]
    if situation.changepoints is not None:
        found.insert(0, _pulse_in(situation.changepoints))
    return [{**values, "rising_share": HALF_RISING} for values in found]


def guess_hoisting(situation: GuessContext) -> list[Values]:
    """From motion to motion, and as long as the windows; with soft edges and with sharp ones."""
    sharp = [{**_pulse_in(w), "rising_share": SHARPEST} for w in situation.windows[1:]]
    parted = situation.changepoints
    return sharp if parted is None else [_pulse_in(parted), {**_pulse_in(parted), "rising_share": SHARPEST}, *sharp]


def guess_trolley(situation: GuessContext) -> list[Values]:
    """Two ramps at the ends, short and long ones between the motions, middling ones in the windows."""
    found = [_trapezoid_in(w, MIDDLING_RAMP) for w in situation.windows[2:]]
    parted = situation.changepoints
    return found if parted is None else [_trapezoid_in(parted, ramp) for ramp in RAMPS] + found


def _trapezoid_in(window: EventWindow, ramp: float) -> Values:
    length_s = max(window.to_s - window.from_s, 2.0)
    return {
        "start_s": window.from_s + OFF_GRID_S,
        "duration_s": ramp * length_s,
        "coast_s": (1 - 2 * ramp) * length_s,
    }


def _pulse_in(window: EventWindow, wider: float = 1.0) -> Values:
    middle_s, length_s = (window.from_s + window.to_s) / 2, wider * max(window.to_s - window.from_s, 2.0)
    return {"start_s": middle_s - length_s / 2 + OFF_GRID_S, "duration_s": length_s}


def guess_vibration(situation: GuessContext) -> list[Values]:
    """At the strongest line above the pendulum's frequencies; none if there is none, or an overtone of a second mode."""
    o = situation.observations
    line = find_machine_line(o.time_s, situation.residual_g, o.noise_g)
    if line is None or _is_overtone(situation, line.frequency_hz):
        return []
    return [guess_sinusoids(line.frequency_hz, line.phasors_g)]


def _is_overtone(situation: GuessContext, line_hz: float) -> bool:
    """A multiple of the main line of the swings, as far as the recording tells: a wide motion's readings are not sines.

    Where that line itself is left, its multiples may stand beside themselves, too: a figure that turns splits them.
    """
    o = situation.observations
    lateral = (o.force_g - o.force_g.mean(axis=0)) * [1.0, 1.0, 0.0] * np.hanning(len(o.force_g))[:, None] / o.noise_g
    main = find_strongest_line(o.time_s, lateral, SECOND_HZ, SWINGS_HZ[1])
    if main is None or main.total < EVIDENT:
        return False
    left_g, size_g = (fit_sine_phasors(o.time_s, situation.residual_g, hz) for hz in (main.frequency_hz, line_hz))
    if line_hz < OVERTONES[-1] * main.frequency_hz and np.linalg.norm(left_g) > MUCH_STRONGER * np.linalg.norm(size_g):
        return True
    off_hz = np.abs(line_hz - np.array(OVERTONES) * main.frequency_hz)
    return bool((off_hz < TURNS_OFF / o.duration_s).any())


def guess_sinusoids(frequency_hz: float, phasors: NDArray[np.complex128]) -> Values:
    """a sin(angle + phase - lag) is Re(c exp(i angle)) with c = a exp(i (phase - lag))/i."""
    phase, *others = (float(p) for p in _wrap_angle(np.angle(phasors) + np.pi / 2))
    lags = tuple(float(lag) for lag in _wrap_angle(phase - np.array(others)))
    amplitudes = tuple(float(a) for a in np.abs(phasors))
    return {"frequency_hz": frequency_hz, "amplitude_g": amplitudes, "lag_rad": lags, "phase_rad": phase}


def _wrap_angle(angle_rad: Array) -> Array:
    found: Array = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    return found


def guess_rope_stretch(situation: GuessContext) -> list[Values]:
    """At the strongest line of the axial reading, if it stands out."""
    o = situation.observations
    axial = situation.residual_g * [0.0, 0.0, 1.0] / o.noise_g
    line = find_strongest_line(o.time_s, axial, *BOUNCE_HZ)
    return [] if line is None or line.power[2] < BOUNCING else [{"frequency_hz": line.frequency_hz}]


def guess_double_pendulum(situation: GuessContext) -> list[Values]:
    """Rigging and hook whose slow mode is near the believed swing and whose fast mode is the strongest line above it.

    Either may be the stronger one. A line whose size or frequency changes has flanks that outdo the other mode's line: the
    window takes them away but near the line, and each mode is looked for on its own side.
    """
    o, rig = situation.observations, situation.rig
    lateral = o.force_g * [1.0, 1.0, 0.0] / o.noise_g
    between_hz = APART[0] * float(np.sqrt(rig.gravity_m_s2 / rig.length_m)) / (2 * np.pi)
    slow = _find_evident_line(o.time_s, lateral, SWINGS_HZ[0], between_hz)
    if slow is None:
        return []
    swing = np.linalg.norm(fit_sine_phasors(o.time_s, lateral, slow))
    for hz in slow * np.array([1.0, 2.0, 3.0]):
        phasors = fit_sine_phasors(o.time_s, lateral, hz)
        lateral = lateral - (phasors * np.exp(2j * np.pi * hz * o.time_s)[:, None]).real
    fast = _find_evident_line(o.time_s, lateral, between_hz, SWINGS_HZ[1])
    if fast is None or not APART[0] < fast / slow < APART[1]:
        return []
    if np.linalg.norm(fit_sine_phasors(o.time_s, lateral, fast)) < LEAST_FAST * swing:
        return []
    found: list[Values] = []
    ratio = np.geomspace(0.01, 3.0, 300)
    for part in RIGGING_PARTS:
        # The fast mode at a large swing is slower than the small-swing formula says, so many pairs are worth a look.
        length_m = part * rig.length_m
        fast_hz = modes_hz(rig, np.full_like(ratio, length_m), ratio)[1]
        best = int(np.argmin(np.abs(fast_hz - FASTER * fast)))
        found.append({"rigging_length_m": length_m, "hook_mass_ratio": float(ratio[best])})
    return found


def _find_evident_line(time_s: Array, lateral: Array, from_hz: float, to_hz: float) -> float | None:
    """Frequency of the strongest line in a band, if it stands out."""
    windowed = (lateral - lateral.mean(axis=0)) * np.hanning(len(lateral))[:, None]
    line = find_strongest_line(time_s, windowed, from_hz, to_hz)
    return None if line is None or float(line.power[:2].sum()) < EVIDENT else line.frequency_hz


def modes_hz(rig: TwinRig, rigging_m: Array, hook_mass_ratio: Array) -> tuple[Array, Array]:
    """Slow and fast mode of a double pendulum whose whole length is the rope's."""
    r, sum_1_m = 1 / hook_mass_ratio, 1 / (rig.length_m - rigging_m) + 1 / rigging_m
    product_1_m2 = 1 / ((rig.length_m - rigging_m) * rigging_m)
    root = np.sqrt((1 + r) ** 2 * sum_1_m**2 - 4 * (1 + r) * product_1_m2)
    slow, fast = (np.sqrt(rig.gravity_m_s2 / 2 * ((1 + r) * sum_1_m + sign * root)) / (2 * np.pi) for sign in (-1, 1))
    return slow, fast


def guess_spin_rate(situation: GuessContext) -> list[Values]:
    """As fast as the swing's figure turns in the housing's axes.

    x + i y of a swing holds lines at +f and -f; turning by Omega moves both to one side.
    """
    o = situation.observations
    figure = o.force_g[:, 0] + 1j * o.force_g[:, 1]
    window = np.hanning(len(figure))
    transform = np.abs(np.fft.fft((figure - figure.mean()) * window, 8 * len(figure)))
    frequency_hz = np.fft.fftfreq(8 * len(figure), o.duration_s / (len(figure) - 1))
    ahead, back = (np.abs(frequency_hz - sign * SWING_MIDDLE_HZ) < SWING_MIDDLE_HZ * 0.95 for sign in (1, -1))
    plus_hz, minus_hz = (float(frequency_hz[part][np.argmax(transform[part])]) for part in (ahead, back))
    rate_deg_s = -180.0 * (plus_hz + minus_hz)
    return [{"rate_deg_s": rate_deg_s}, {}] if abs(rate_deg_s) > SLOWEST_TURN_DEG_S else [{}]


def default_guess(name: str) -> Values:
    """Of an effect that is there all the time: neutral, but a low-pass in the middle of what matters to a swing."""
    return {"cutoff_hz": 2.0} if name == "lowpass_lag" else {}


def guess_full_scale(situation: GuessContext) -> list[Values]:
    """At the largest reading, where several stand exactly at it: noise comes before a limit, so it leaves them equal."""
    o = situation.observations
    size = np.abs(o.force_g)
    top_g = float(size.max())
    return [{"full_scale_g": top_g}] if (size > top_g - WRITTEN_RESOLUTION_G).sum() >= AT_LIMIT else []


INITIAL_GUESSES: dict[str, Callable[[GuessContext], list[Values]]] = {
    "housing_spin": guess_spin_rate,
    "slewing": guess_spin_rate,
    "wind_gust": guess_gust,
    "impact": guess_impact,
    "trolley_acceleration": guess_trolley,
    "hoisting": guess_hoisting,
    "load_change": guess_impact,
    "vibration": guess_vibration,
    "rope_stretch": guess_rope_stretch,
    "double_pendulum": guess_double_pendulum,
    "clipping": guess_full_scale,
}
