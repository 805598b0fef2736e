"""What is there before anything is searched for: which data are held out, steps and limits of the readings, a machine's line."""

from collections.abc import Mapping
from dataclasses import replace

from gateway.numerics.spectrum import find_machine_line
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Value
from gateway.twin.effects.sensor import Vibration
from gateway.twin.effects.sensor_output import Clipping, Quantization
from gateway.twin.reconcile.data.artefact_detectors import (
    detect_quantisation_step,
    detect_saturation,
    noise_with_quantisation_g,
)
from gateway.twin.reconcile.data.observations import Observations, Recordings, slice_samples
from gateway.twin.reconcile.fit.validation import evaluate_on_validation
from gateway.twin.reconcile.search.candidate_fits import MIN_VARIANCE_SHARE, CandidateFit
from gateway.twin.reconcile.search.search import Search

Values = Mapping[str, Mapping[str, Value]]
HELD_OUT_SHARE = 1 / 3
"""Part at the end of the log that is held out where there is no second recording."""
MIN_REPEATED_GAIN = 0.5
"""A gain that is more than an accident of one recording, or of its steps, comes to at least this part in the other look."""


def prepare_recordings(log: Observations, held_out: Observations | None) -> Recordings:
    """What is fitted to, and what is judged on: the second recording, or the log's end."""
    if held_out is not None:
        return Recordings(log, held_out, held_out, last_third=False)
    cut = int(len(log.time_s) * (1 - HELD_OUT_SHARE))
    held_back = slice_samples(log, cut, len(log.time_s))
    return Recordings(slice_samples(log, 0, cut), held_back, held_back, last_third=True)


def detect_in_samples(recordings: Recordings) -> tuple[Recordings, Values]:
    """Steps and limits, which need no model."""
    log, held_out = recordings.log, recordings.held_out
    step_g = detect_quantisation_step(log.force_g, log.noise_g)
    if step_g is not None:
        coarse = noise_with_quantisation_g(log, step_g)
        log, held_out = replace(log, noise_g=coarse), replace(held_out, noise_g=coarse)
        return Recordings(log, held_out, held_out, recordings.last_third), {Quantization.name: {"lsb_g": step_g}}
    limit_g = detect_saturation(log.force_g)
    return recordings, {} if limit_g is None else {Clipping.name: {"full_scale_g": limit_g}}


def initialise_baseline(
    search: Search, start: CandidateFit, always: Values, held_out: Observations
) -> tuple[Search, CandidateFit]:
    """The search on what is always there: what the values show, and a machine's line."""
    base = search.fit_candidate(always) or start
    search.baseline_effects = add_machine_line(search, base, always, held_out)
    return search, search.candidates[frozenset(search.baseline_effects)]


def add_machine_line(search: Search, base: CandidateFit, always: Values, held_out: Observations) -> Values:
    """A machine's line stands far above the swing's frequencies and hides nothing: it is added before the search.

    Only if the same line is in the held-out recording, too: steps of the readings and the swing make lines of their own. So do
    a second mode and a bounce, up to several times their frequency: the line is looked for in what those leave.
    """
    log, rig, effects = search.setting.log, search.setting.rig, search.setting.model_effects
    if Vibration.name in effects or find_machine_line(log.time_s, log.force_g - base.fit.force_g, log.noise_g) is None:
        return always
    beside = search.add_second_mode(base)
    found = EFFECTS[Vibration.name].initial_guesses(search.setting.guess_context(log.force_g - beside.fit.force_g))
    if not found:
        return always
    tried = search.fit_candidate({**beside.values, Vibration.name: found[0]})
    if tried is None or beside.fit.chi2 - tried.fit.chi2 < MIN_VARIANCE_SHARE * log.n_values:
        return always
    without, with_it = (
        evaluate_on_validation(rig, {**effects, **each.values}, held_out).reduced_chi2 for each in (beside, tried)
    )
    if without - with_it < MIN_REPEATED_GAIN * (beside.reduced_chi2 - tried.reduced_chi2):
        return always
    alone = (
        tried if beside is base else search.fit_candidate({**base.values, Vibration.name: tried.values[Vibration.name]})
    )
    return always if alone is None else {name: alone.values[name] for name in (*always, Vibration.name)}
