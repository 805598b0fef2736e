"""A recording made ready for reconciliation, and the reasons for which it is not fit for it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.errors import InputError
from gateway.measurement.source import Source
from gateway.numerics.robust import robust_sigma
from gateway.numerics.runs import true_runs
from gateway.twin.model import Model, TwinRig
from gateway.twin.reconcile.data.observations import Observations, make_observations

Array = NDArray[np.float64]
MIN_PERIODS = 2.0
"""Least number of swings in a recording that says anything of a pendulum."""
MIN_SAMPLES = 200
MIN_SIGNAL_TO_NOISE = 3.0
"""The swing must stand out of the noise by this factor, lateral rms over noise, averaged over a tenth of a swing."""
MIN_SWING_RMS_G = 1e-4
EXCESS_NOISE_FACTOR = 3.0
MAX_STUCK_SHARE = 0.9
PLAUSIBLE_NORM_G = (0.5, 2.0)
"""Median of the norm: outside, the numbers are not in g."""
FREE_FALL_G, MAX_FREE_FALL_PERIODS = 0.3, 0.1
"""A rope is slack where the norm stays below this for more than this part of a swing's period."""
MAX_RHO_FREE_FALL_CHECK = 0.7
"""Share of the rope from which a housing may well read that little at the top of a wide swing."""
SAME_FREQUENCY_RATIO, WRONG_FREQUENCY_RATIO, MIN_POWER_SHARE = 1.15, 1.25, 0.01
"""The rig is not this one when the swing's frequency is off by a quarter (the rope by 1.6), and less than this part of the power
is near the believed frequency; a second mode may be the stronger one."""
NEIGHBOURHOOD_RATIO, MIN_LINE_TO_NEIGHBOURS = 2.0, 10.0
"""Beside a strong second mode: a line that much above all else within a factor of two of the believed frequency is the swing."""


@dataclass(frozen=True, slots=True)
class CheckedRecording:
    """A recording, or why it cannot be used."""

    observations: Observations | None
    fault: str | None
    counts: Mapping[str, int]
    time_s: Array
    """As recorded, shape (n,)."""


def model_from_recording(source: Source) -> Model:
    """The rig that a recording brings with it. Raises `InputError` where it brings none."""
    housing = source.housing
    if housing is None:
        raise InputError(
            f"{source.path}: says nothing of its rig; give --rig RIG, with [rope] length_m and [housing] position_m"
        )
    noise_g = np.broadcast_to(np.asarray(1e-3 if source.noise_g is None else source.noise_g, dtype=np.float64), 3)
    twin = TwinRig(
        housing.length_m,
        housing.position_at(housing.length_m),
        housing.gravity_m_s2,
        (float(noise_g[0]), float(noise_g[1]), float(noise_g[2])),
        full_scale_g=source.full_scale_g,
    )
    return Model(twin, {})


def check_recording(source: Source, twin: TwinRig) -> CheckedRecording:
    """A recording with lone spikes marked; looks first whether it says anything."""
    recording = source.recording
    counts = {
        "read": len(recording.time_s),
        "lost": int(recording.lost_before.sum()),
        "repeated": recording.repeated,
        "backward": recording.backward,
        "invalid": recording.invalid,
    }
    fault = find_fault(recording.time_s, source.force_g, twin)
    if fault is not None:
        return CheckedRecording(None, fault, counts, recording.time_s)
    warm = recording.temperature_c
    if warm is not None and np.isfinite(warm).sum() < MIN_SAMPLES:
        warm = None
    observations = make_observations(recording.time_s, source.force_g, warm, np.array(twin.noise_g))
    counts["spikes"] = int((~observations.used).sum())
    return CheckedRecording(observations, None, counts, recording.time_s)


def find_fault(time_s: Array, force_g: Array, twin: TwinRig) -> str | None:
    """Why a recording says nothing about a model, and what would do; None where it can be used."""
    if len(time_s) < MIN_SAMPLES:
        return f"too short: {len(time_s)} usable samples; record at least {MIN_SAMPLES}, over some swings"
    period_s = twin.small_swing_period_s
    duration_s = float(time_s[-1] - time_s[0])
    norm = float(np.median(np.linalg.norm(force_g, axis=1)))
    if not PLAUSIBLE_NORM_G[0] < norm < PLAUSIBLE_NORM_G[1]:
        unit = " (m/s²?)" if 9 < norm < 11 else " (mg?)" if 500 < norm < 2000 else ""
        return f"wrong units: the readings' norm is {norm:.3g}{unit}, at rest it is 1 g; give them in g"
    falling_s = _longest_fall_s(time_s, force_g)
    if falling_s > MAX_FREE_FALL_PERIODS * period_s and twin.position_m < MAX_RHO_FREE_FALL_CHECK * twin.length_m:
        return (
            f"in free fall: the readings stay below {FREE_FALL_G:g} g for {falling_s:.2g} s, no rope was taut; "
            "record with the housing clamped to the rope"
        )
    if duration_s < MIN_PERIODS * period_s:
        return f"too short: {duration_s:.3g} s, a swing of this rig takes {period_s:.3g} s; record at least {3 * period_s:.0f} s"
    stuck = [float(np.mean(np.abs(axis - np.median(axis)) < 1e-9)) for axis in force_g.T]
    if max(stuck) > MAX_STUCK_SHARE:
        return "clipped or stuck throughout: an axis gives the same value all the time; set a wider range"
    return _find_swing_fault(time_s, force_g, twin, period_s)


def _longest_fall_s(time_s: Array, force_g: Array) -> float:
    """Longest time for which the norm of (n, 3) stays below `FALL_G`."""
    falling = true_runs(np.linalg.norm(force_g, axis=1) < FREE_FALL_G)
    return max((float(time_s[stop - 1] - time_s[start]) for start, stop in falling), default=0.0)


def _find_swing_fault(time_s: Array, force_g: Array, twin: TwinRig, period_s: float) -> str | None:
    lateral = (force_g[:, :2] - force_g[:, :2].mean(axis=0)).T
    step = max(1, int(len(time_s) * 0.1 * period_s / (time_s[-1] - time_s[0])))
    count = len(time_s) // step
    binned = lateral[:, : count * step].reshape(2, count, step).mean(axis=2)
    stated_g = float(np.mean(twin.noise_g[:2]))
    seen_g = float(robust_sigma(np.diff(force_g[:, :2], axis=0).ravel())) / np.sqrt(2)
    noise_g = max(stated_g, seen_g) / np.sqrt(step)
    rms_g = float(np.sqrt((binned**2).sum(axis=0).mean() / 2))
    if rms_g < MIN_SIGNAL_TO_NOISE * noise_g and seen_g > EXCESS_NOISE_FACTOR * stated_g:
        return (
            f"too noisy: {seen_g * 1e3:.2g} mg where {stated_g * 1e3:.2g} mg is believed hides the swing; "
            "mend the sensor or its mount"
        )
    if rms_g < max(MIN_SWING_RMS_G, MIN_SIGNAL_TO_NOISE * noise_g):
        return (
            f"static: nothing swings beyond the noise of {stated_g * 1e3:.2g} mg; let the load swing by a few degrees"
        )
    bin_s = (time_s[-1] - time_s[0]) / count
    power = (np.abs(np.fft.rfft(binned * np.hanning(count), 8 * count, axis=1)) ** 2).sum(axis=0)
    frequency_hz = np.fft.rfftfreq(8 * count, bin_s)
    band = frequency_hz > 0.2 / period_s
    found_hz = float(frequency_hz[band][np.argmax(power[band])])
    elsewhere = abs(np.log(found_hz * period_s)) > np.log(WRONG_FREQUENCY_RATIO)
    if elsewhere and not _frequency_matches_rig(frequency_hz[band], power[band], period_s):
        length_m = twin.gravity_m_s2 / (2 * np.pi * found_hz) ** 2
        return (
            f"the rig is wrong: the load swings once in {1 / found_hz:.3g} s, a rope of {twin.length_m:.4g} m would in "
            f"{period_s:.3g} s; check rope.length_m ({length_m:.3g} m would fit)"
        )
    return None


def _frequency_matches_rig(frequency_hz: Array, power: Array, period_s: float) -> bool:
    """Much of the power is at the believed frequency; or a line stands there alone, below a second mode that is the main one."""
    off = np.log(frequency_hz * period_s)
    near = np.abs(off) < np.log(SAME_FREQUENCY_RATIO)
    at_belief = power[near].max(initial=0.0)
    if at_belief >= MIN_POWER_SHARE * power.max():
        return True
    around = power[~near & (np.abs(off) < np.log(NEIGHBOURHOOD_RATIO))]
    second_mode = off[np.argmax(power)] > np.log(WRONG_FREQUENCY_RATIO)
    return bool(second_mode and len(around) and at_belief > MIN_LINE_TO_NEIGHBOURS * around.max())
