"""Effects found before the search: steps and limits of the samples, a wrong length by the period, a machine's line."""

from dataclasses import replace

import numpy as np

from gateway.numerics.spectrum import find_machine_line
from gateway.swing.detection.rope_length import rope_length_by_period
from gateway.twin.effects.rope import RopeLength
from gateway.twin.effects.sensor import Vibration
from gateway.twin.effects.sensor_output import Clipping, Quantization, SampleHold
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.recordings import Recordings
from gateway.twin.reconcile.data.sensor import (
    MIN_NAMED_STEP_SIGMA,
    detect_quantisation_step,
    detect_saturation,
    noise_with_quantisation_g,
)
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.search.candidates import MIN_VARIANCE_SHARE, CandidateFit, CandidateTable
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.validation import Validator

MIN_REPEATED_GAIN = 0.5
"""Gain of an effect on another part of the data over its gain on the log, from which it is no accident of the log."""


def detect_in_samples(
    recordings: Recordings, rows_per_reading: float, model: EffectValues
) -> tuple[Recordings, EffectValues]:
    """Detect steps, limits and repeats of the samples, which need no model; steps add their variance to the noise.

    `model` are the effects that are known already.
    """
    recordings, detected = _detect_steps_or_limits(recordings)
    if rows_per_reading > 1 and SampleHold.name not in model:
        detected = {**detected, SampleHold.name: {"rows": rows_per_reading}}
    return recordings, detected


def _detect_steps_or_limits(recordings: Recordings) -> tuple[Recordings, EffectValues]:
    log, held_out = recordings.log, recordings.held_out
    step_g = detect_quantisation_step(log.force_g, log.noise_g)
    if step_g is not None:
        noise_g = noise_with_quantisation_g(log, step_g)
        log, held_out = replace(log, noise_g=noise_g), replace(held_out, noise_g=noise_g)
        is_named = step_g > MIN_NAMED_STEP_SIGMA * float(np.min(recordings.log.noise_g))
        coarse = replace(recordings, log=log, held_out=held_out, held_out_as_stamped=held_out)
        return coarse, {Quantization.name: {"lsb_g": step_g}} if is_named else {}
    limit_g = detect_saturation(log.force_g)
    return recordings, {} if limit_g is None else {Clipping.name: {"full_scale_g": limit_g}}


def fit_baseline(
    table: CandidateTable, context: SearchContext, detected: EffectValues, validator: Validator
) -> tuple[CandidateTable, SearchContext]:
    """Fit the effects that were detected, a wrong length and a machine's line; the search starts from these."""
    if table.get(detected) is None:
        table = context.fit(table, detected)
    base = table.get(detected) or table.fits[frozenset()]
    table, base = _add_rope_length(table, context, base)
    context = context.with_baseline({name: base.values[name] for name in base.values})
    return _add_machine_line(table, context, base, validator)


def _add_rope_length(
    table: CandidateTable, context: SearchContext, base: CandidateFit
) -> tuple[CandidateTable, CandidateFit]:
    """Add an error of the rope's length where the period of a large swing, at its amplitude, contradicts the rig.

    Beside a model that is soon out of phase no effect shows as what it is. Backward elimination removes an error that a model
    with losses does not need; the model without them does not tell.
    """
    error = length_error_by_period(context.setting) if context.setting.large_amplitude else None
    if error is None:
        return table, base
    values = {**base.values, RopeLength.name: {"relative_error": error}}
    table = context.fit(table, values)
    return table, table.get(values) or base


def _add_machine_line(
    table: CandidateTable, context: SearchContext, base: CandidateFit, validator: Validator
) -> tuple[CandidateTable, SearchContext]:
    """Add a machine's line, which is far above the swing's frequencies and hides nothing.

    Only a line that is in the held-out recording, too: steps of the samples and the swing make lines of their own.
    """
    log, setting = context.setting.log, context.setting
    if Vibration.name in setting.model_effects:
        return table, context
    if find_machine_line(log.time_s, log.force_g - base.fit.force_g, log.noise_g) is None:
        return table, context
    guesses = context.guesses(Vibration.name, base)
    if not guesses:
        return table, context
    table = context.fit(table, {**base.values, Vibration.name: guesses[0]})
    found = table.get({*base.values, Vibration.name})
    if found is None or base.fit.chi2 - found.fit.chi2 < MIN_VARIANCE_SHARE * log.n_values:
        return table, context
    without, with_line = (validator.evaluate(each).reduced_chi2 for each in (base, found))
    is_repeated = without - with_line > MIN_REPEATED_GAIN * (base.reduced_chi2 - found.reduced_chi2)
    return table, context.with_baseline(found.values) if is_repeated else context


def length_error_by_period(setting: FitContext) -> float | None:
    """Return the relative error of the rope's length where the period, at its amplitude, contradicts the rig; else None."""
    rig, log = setting.rig, setting.log
    by_period = rope_length_by_period(log.time_s, log.force_g, rig.gravity_m_s2)
    if by_period is None:
        return None
    error = by_period.length_m / rig.length_m - 1
    stated = float(np.asarray(setting.model_effects.get(RopeLength.name, {}).get("relative_error", 0.0)))
    return error if abs(error - stated) >= by_period.u_rel else None
