"""Checks whether a recording can be reconciled with a model of a swing."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.errors import InputError
from gateway.measurement.source import Source
from gateway.numerics.stats import robust_sigma, true_runs
from gateway.swing.data.input_checks import WITHOUT_GRAVITY, lacks_gravity
from gateway.twin.model import DEFAULT_NOISE_G, Model, TwinRig
from gateway.twin.reconcile.data.observations import (
    MIN_LINE_SHARE,
    NEIGHBOUR_RATIO,
    SAME_FREQUENCY_RATIO,
    Observations,
    has_axial_swing,
    make_observations,
    unmeasured_axes,
)
from gateway.twin.reconcile.data.sensor import constant_share, detect_quantisation_step, regular_reading_times

Array = NDArray[np.float64]
MIN_PERIODS = 2.0
"""Shortest recording, and window of a recording, that determines a trajectory, in periods of the swing."""
MIN_SAMPLES = 200
"""Fewest samples of a recording; about ten parameters are fitted to them."""
SHORT_PERIODS = 0.1
"""A time in which a swing hardly moves, in periods: samples are averaged over it, and a free fall lasts longer."""
DETECTION_SIGMA = 3.0
"""Ratio to the noise from which a deviation is real: noise alone exceeds it once in 370."""
MIN_SWING_RMS_G = 1e-4
"""Smallest swing, g rms of the lateral axes, however small the noise: 6 millidegrees at the pivot."""
MAX_CONSTANT_SHARE = 0.9
"""Share of equal readings above which an axis is constant."""
PLAUSIBLE_NORM_G = (0.5, 2.0)
"""Median of the norm outside of which the numbers are not in g."""
FREE_FALL_G = 0.3
"""Norm below which the rope is slack."""
MAX_FREE_FALL_RHO = 0.7
"""Position over rope length up to which free fall is checked: nearer the load, the top of a large swing reads as little."""
WRONG_FREQUENCY_RATIO = 1.25
"""Ratio of the swing's frequency to the rig's from which the rig is wrong; the rope length is then wrong by 1.6."""
MIN_LINE_TO_NEIGHBOURS = 10.0
"""Power ratio to these neighbours from which the weaker line is the swing."""


@dataclass(frozen=True, slots=True)
class CheckedRecording:
    """A recording, or the reason why it cannot be used."""

    observations: Observations | None
    fault: str | None
    counts: Mapping[str, int]
    """Numbers of samples by what happened to them."""
    time_s: Array
    """As recorded, shape (n,)."""
    rows_per_reading: float = 1.0
    """Rows of the file over readings of the sensor; more than 1 where it repeats them."""


def model_from_recording(source: Source) -> Model:
    """Return the rig that a recording contains. Raises `InputError` where it contains none."""
    housing = source.housing
    if housing is None:
        raise InputError(
            f"{source.name}: says nothing of its rig; give --rig RIG, with [rope] length_m and [housing] position_m"
        )
    noise_g = np.broadcast_to(
        np.asarray(DEFAULT_NOISE_G if source.noise_g is None else source.noise_g, dtype=np.float64), 3
    )
    twin = TwinRig(
        housing.length_m,
        housing.position_at(housing.length_m),
        housing.gravity_m_s2,
        (float(noise_g[0]), float(noise_g[1]), float(noise_g[2])),
        full_scale_g=source.full_scale_g,
    )
    return Model(twin, {})


def check_recording(source: Source, twin: TwinRig) -> CheckedRecording:
    """Return the observations of a recording, with spikes excluded, or the fault that makes it unusable."""
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
    time_s, rows_per_reading = recording.time_s, 1.0
    if source.repeated_readings:
        counts["repeated_readings"] = source.repeated_readings
        rows_per_reading += source.repeated_readings / len(time_s)
        time_s = regular_reading_times(time_s, rows_per_reading)
    temperature_c = recording.temperature_c
    if temperature_c is not None and np.isfinite(temperature_c).sum() < MIN_SAMPLES:
        temperature_c = None
    observations = make_observations(time_s, source.force_g, temperature_c, np.array(twin.noise_g))
    counts["spikes"] = int((~observations.used).sum())
    return CheckedRecording(observations, None, counts, recording.time_s, rows_per_reading)


def find_lack_of_rest(twin: TwinRig, *parts: Observations) -> str | None:
    """Return why parts of the data cannot be used in which the crane works nearly all the time; None where they can."""
    for part in parts:
        resting_s = float(part.used.mean()) * part.duration_s
        if resting_s < MIN_PERIODS * twin.small_swing_period_s:
            return (
                f"the crane works: it rests for {resting_s:.3g} s of a part of {part.duration_s:.3g} s; record a swing of "
                f"at least {3 * twin.small_swing_period_s:.0f} s with the crane at rest"
            )
    return None


def find_fault(time_s: Array, force_g: Array, twin: TwinRig) -> str | None:
    """Return why a recording cannot be used, and what would be usable; None where it can."""
    if len(time_s) < MIN_SAMPLES:
        return f"too short: {len(time_s)} usable samples; record at least {MIN_SAMPLES}, over some swings"
    period_s = twin.small_swing_period_s
    duration_s = float(time_s[-1] - time_s[0])
    norm_g = float(np.median(np.linalg.norm(force_g, axis=1)))
    if not PLAUSIBLE_NORM_G[0] < norm_g < PLAUSIBLE_NORM_G[1]:
        unit = " (m/s²?)" if 9 < norm_g < 11 else " (mg?)" if 500 < norm_g < 2000 else ""
        return f"wrong units: the norm of the readings is {norm_g:.3g}{unit}, at rest it is 1 g; give them in g"
    if lacks_gravity(force_g):
        return WITHOUT_GRAVITY
    falling = true_runs(np.linalg.norm(force_g, axis=1) < FREE_FALL_G)
    falling_s = max((float(time_s[stop - 1] - time_s[start]) for start, stop in falling), default=0.0)
    if falling_s > SHORT_PERIODS * period_s and twin.position_m < MAX_FREE_FALL_RHO * twin.length_m:
        return (
            f"in free fall: the readings stay below {FREE_FALL_G:g} g for {falling_s:.2g} s, no rope was taut; "
            "record with the housing clamped to the rope"
        )
    if duration_s < MIN_PERIODS * period_s:
        return (
            f"too short: {duration_s:.3g} s, the period of this rig is {period_s:.3g} s; "
            f"record at least {3 * period_s:.0f} s"
        )
    return _find_constant_axis(force_g, twin) or _find_swing_fault(time_s, force_g, twin)


def _find_constant_axis(force_g: Array, twin: TwinRig) -> str | None:
    """Return a fault where an axis is constant, and not because the swing is less than a quantisation step."""
    medians_g = np.median(force_g, axis=0)
    unmeasured = unmeasured_axes(force_g)
    if unmeasured[:2].sum() == 1:  # the plane of the swing alone
        force_g, medians_g = force_g[:, ~unmeasured], medians_g[~unmeasured]
    constant = (np.abs(force_g - medians_g) < 1e-9).mean(axis=0) > MAX_CONSTANT_SHARE
    if not constant.any():
        return None
    if constant.all():
        return "stuck or quantised throughout: no axis changes; set a smaller range, or let the load swing wider"
    step_g = _hiding_step_g(force_g, twin)
    limit_g = np.inf if twin.full_scale_g is None or step_g is None else twin.full_scale_g - step_g
    if step_g is None or np.abs(medians_g[constant]).max() > limit_g:
        return "clipped or stuck throughout: an axis gives the same value all the time; set a wider range"
    return None


def _hiding_step_g(force_g: Array, twin: TwinRig) -> float | None:
    """Return the quantisation step where it is so large that an axis can be constant in spite of its noise."""
    noise_g = np.array(twin.noise_g)
    step_g = detect_quantisation_step(force_g, noise_g)
    return None if step_g is None or constant_share(step_g, noise_g) < MAX_CONSTANT_SHARE else step_g


def _find_swing_fault(time_s: Array, force_g: Array, twin: TwinRig) -> str | None:
    """Return a fault where no swing exceeds the noise, or where its frequency is not that of the rig.

    A swing shows across the rope, and along it at twice its frequency: near the load there alone.
    """
    fault = _find_lateral_fault(time_s, force_g, twin)
    return None if fault is None or has_axial_swing(time_s, force_g, twin.small_swing_period_s) else fault


def _find_lateral_fault(time_s: Array, force_g: Array, twin: TwinRig) -> str | None:
    duration_s, period_s = float(time_s[-1] - time_s[0]), twin.small_swing_period_s
    lateral_g = (force_g[:, :2] - force_g[:, :2].mean(axis=0)).T
    bin_samples = max(1, int(len(time_s) * SHORT_PERIODS * period_s / duration_s))
    n_bins = len(time_s) // bin_samples
    binned_g = lateral_g[:, : n_bins * bin_samples].reshape(2, n_bins, bin_samples).mean(axis=2)
    stated_g = float(np.mean(twin.noise_g[:2]))
    seen_g = float(robust_sigma(np.diff(force_g[:, :2], axis=0).ravel())) / np.sqrt(2)
    detectable_g = DETECTION_SIGMA * max(stated_g, seen_g) / np.sqrt(bin_samples)
    rms_g = float(np.sqrt((binned_g**2).sum(axis=0).mean() / 2))
    if rms_g < detectable_g and seen_g > DETECTION_SIGMA * stated_g:
        return (
            f"too noisy: {seen_g * 1e3:.2g} mg where {stated_g * 1e3:.2g} mg is believed hides the swing; "
            "mend the sensor or its mount"
        )
    if rms_g < max(MIN_SWING_RMS_G, detectable_g):
        return _static_fault(_hiding_step_g(force_g, twin), stated_g)
    return _find_wrong_frequency(binned_g, duration_s / n_bins, twin)


def _static_fault(step_g: float | None, stated_g: float) -> str:
    if step_g is None:
        return (
            f"static: nothing swings beyond the noise of {stated_g * 1e3:.2g} mg; let the load swing by a few degrees"
        )
    return (
        f"static or quantised: nothing swings beyond the steps of {step_g * 1e3:.2g} mg; "
        "set a smaller range, or let the load swing wider"
    )


def _find_wrong_frequency(binned_g: Array, bin_s: float, twin: TwinRig) -> str | None:
    """Return a fault where the lateral readings (2, bins) have no line at the frequency of the rig."""
    n_bins, period_s = binned_g.shape[1], twin.small_swing_period_s
    power = (np.abs(np.fft.rfft(binned_g * np.hanning(n_bins), 8 * n_bins, axis=1)) ** 2).sum(axis=0)
    frequency_hz: Array = np.fft.rfftfreq(8 * n_bins, bin_s).astype(np.float64)
    band = frequency_hz > 0.2 / period_s
    found_hz = float(frequency_hz[band][np.argmax(power[band])])
    differs = abs(np.log(found_hz * period_s)) > np.log(WRONG_FREQUENCY_RATIO)
    if not differs or _has_line_of_rig(frequency_hz[band], power[band], period_s):
        return None
    length_m = twin.gravity_m_s2 / (2 * np.pi * found_hz) ** 2
    return (
        f"the rig is wrong: the load swings once in {1 / found_hz:.3g} s, a rope of {twin.length_m:.4g} m would in "
        f"{period_s:.3g} s; check rope.length_m ({length_m:.3g} m would fit)"
    )


def _has_line_of_rig(frequency_hz: Array, power: Array, period_s: float) -> bool:
    """Return whether the rig's frequency has much power, or a line of its own below a stronger second mode."""
    log_ratio = np.log(frequency_hz * period_s)
    at_rig = np.abs(log_ratio) < np.log(SAME_FREQUENCY_RATIO)
    rig_power = power[at_rig].max(initial=0.0)
    if rig_power >= MIN_LINE_SHARE * power.max():
        return True
    neighbours = power[~at_rig & (np.abs(log_ratio) < np.log(NEIGHBOUR_RATIO))]
    is_second_mode = log_ratio[np.argmax(power)] > np.log(WRONG_FREQUENCY_RATIO)
    return bool(is_second_mode and len(neighbours) and rig_power > MIN_LINE_TO_NEIGHBOURS * neighbours.max())
