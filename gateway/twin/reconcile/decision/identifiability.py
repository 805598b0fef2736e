"""Identifiability: which effects leave the same signature at a fitted model, and so cannot be told apart.

A signature is how the samples respond to an effect's parameters, by linearisation, with what every recording fits anyway
projected out: initial motion and heading. Two effects with the same signature, where the other effects of the model may change
as well, form an ambiguity group, whatever their fits say (isolability, Basseville and Nikiforov 1993). No value may leave what
is possible and what parts have: an effect that would have to is no alternative.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import TAIL_SHARE, limit_of
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.evidence import MIN_EVIDENCE_AGAINST
from gateway.twin.reconcile.fit.fit_context import is_world_directed, sensitivities_sigma
from gateway.twin.reconcile.residual import EXCESS_SIGNIFICANT, excess_chi2
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable, implausibility
from gateway.twin.reconcile.search.context import SearchContext
from gateway.twin.reconcile.search.signatures import orthonormal, project_out, scorable_effects
from gateway.twin.reconcile.search.validation import Validator
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, ParameterSpec

Array = NDArray[np.float64]


MAX_INDISTINGUISHABLE_ANGLE_RAD = 3e-3
"""Angle between an effect's contribution and the nearest one of another effect, up to which no evidence separates them: the
equations of the effects are not true to 0.3 % of a contribution (a jib's radius, a clamp that yields)."""


DISTINCT_ANGLE_RAD = 0.1
"""Angle from which two effects differ whatever the model leaves unexplained: losses by different laws are 0.15 apart."""


@dataclass(frozen=True, slots=True)
class FittedRecording:
    """A recording and the initial motion that a model has on it."""

    observations: Observations
    model_effects: EffectValues
    """Effects that the model has on this recording; the inputs of the crane are its own."""
    initial: Array
    """Initial state, heading included, shape (initial states,)."""
    heading_is_fitted: bool
    """False on the log, where the heading is a gauge: turning the world changes nothing."""
    excess_chi2: float
    """Chi-square of the residual beyond what a wrongly stated noise gives: what the model leaves unexplained, 0 or more."""


class Substitutes(Protocol):
    """What could take the place of an effect of a fitted set."""

    def alike(self, name: str) -> tuple[str, ...]:
        """Return the effects that make the same contribution, the most similar first."""

    def alike_pairs(self, name: str) -> tuple[tuple[str, str], ...]:
        """Return the pairs that make it together, the most similar first."""


@dataclass(frozen=True, slots=True)
class Contributions:
    """What the effects of a fitted set contribute to the recordings, and what others could contribute in their place."""

    specs: Sequence[ParameterSpec]
    """Of the values of the set, and of the effects that could take the place of one."""
    fitted: frozenset[str]
    """The effects of the set."""
    triangle: Array
    """Sensitivities in sigma by the values, nuisances projected out, in an orthonormal basis of their own, shape (k, values)."""
    change: Array
    """Of each value from where the effect is as the rig states it, shape (values,)."""
    lower: Array
    upper: Array
    """By how much each value may fall and rise, shape (values,)."""
    excess_chi2: float
    """What the set leaves unexplained on all recordings."""

    def alike(self, name: str) -> tuple[str, ...]:
        """Effects that make the same contribution as one of the set, the most similar first."""
        contribution, size = self._contribution(name)
        # What the model leaves unexplained could be twice the difference between the two effects.
        misfit_rad = 2 * math.sqrt(self.excess_chi2) / size if size else 0.0
        limit_rad = max(MAX_INDISTINGUISHABLE_ANGLE_RAD, min(misfit_rad, DISTINCT_ANGLE_RAD))
        angles_rad = {other: self._angle_rad(name, (other,), contribution, size) for other in self._others(size)}
        alike = (other for other, angle in angles_rad.items() if angle < limit_rad)
        return tuple(sorted(alike, key=lambda other: (angles_rad[other], other)))

    def alike_pairs(self, name: str) -> tuple[tuple[str, str], ...]:
        """Pairs of effects that together make the same contribution as one of the set, and neither alone does.

        As far as the noise could tell: what differs by less than the margin of the evidence is left to it.
        """
        contribution, size = self._contribution(name)
        alone = set(self.alike(name))
        pairs = list(combinations([other for other in self._others(size) if other not in alone], 2))
        angles_rad = {pair: self._angle_rad(name, pair, contribution, size) for pair in pairs}
        noise_rad = math.sqrt(MIN_EVIDENCE_AGAINST) / size if size else 0.0
        limit_rad = max(MAX_INDISTINGUISHABLE_ANGLE_RAD, min(noise_rad, DISTINCT_ANGLE_RAD))
        alike = (pair for pair, angle in angles_rad.items() if angle < limit_rad)
        return tuple(sorted(alike, key=lambda pair: (angles_rad[pair], pair)))

    def _contribution(self, name: str) -> tuple[Array, float]:
        """Return what an effect contributes, and the size of what the others of the set could not, in sigma over all samples."""
        own = _places(self.specs, (name,))
        contribution = self.triangle[:, own] @ self.change[own]
        beside = orthonormal(self.triangle[:, self._beside(name)])
        return contribution, float(np.linalg.norm(project_out(beside, contribution)))

    def _angle_rad(self, name: str, others: Sequence[str], contribution: Array, size: float) -> float:
        """Return the angle between an effect's contribution and the nearest one of others, where the set may change as well."""
        used = [*_places(self.specs, others), *self._beside(name)]
        left = project_out(orthonormal(self.triangle[:, used]), contribution)
        if np.linalg.norm(left) > DISTINCT_ANGLE_RAD * size:
            return math.pi / 2  # not even without bounds
        beyond = distance_within(contribution, self.triangle[:, used], self.lower[used], self.upper[used])
        return math.asin(min(1.0, beyond / size))

    def _beside(self, name: str) -> list[int]:
        return _places(self.specs, self.fitted - {name})

    def _others(self, size: float) -> list[str]:
        """Return the effects that could take the place of one; none of one that contributes nothing."""
        return sorted({spec.effect for spec in self.specs if spec.effect} - self.fitted) if size else []


def find_contributions(
    rig: TwinRig,
    stated: EffectValues,
    fitted: EffectValues,
    others: Iterable[str],
    recordings: Sequence[FittedRecording],
) -> Contributions:
    """Linearise a fitted set beside what the rig states, with `others` that could take the place of an effect of it."""
    model = {**stated, **fitted}
    tried = [other for other in others if other not in fitted and EFFECTS[other].is_scored]
    simulator = Simulator(rig, sorted({*model, *tried}))
    columns = np.concatenate([_project_recording(simulator, rig, model, each) for each in recordings])
    asked = [i for i, spec in enumerate(simulator.parameters) if spec.effect in {*fitted, *tried} and not spec.refitted]
    lower, upper = possible_changes(simulator, model, rig)
    return Contributions(
        specs=[simulator.parameters[i] for i in asked],
        fitted=frozenset(fitted),
        triangle=np.linalg.qr(columns[:, asked])[1],
        change=(simulator.values([], model) - simulator.values([], stated))[asked],
        lower=lower[asked],
        upper=upper[asked],
        excess_chi2=sum(each.excess_chi2 for each in recordings),
    )


def possible_changes(simulator: Simulator, model: EffectValues, rig: TwinRig) -> tuple[Array, Array]:
    """Return by how much each value may fall and rise from that of the model, (values,) each; effects beside it are neutral.

    The ends are the bounds of the parameter and what parts have: beyond it until the prior density is that of a rival that is no
    alternative (`MIN_EVIDENCE_AGAINST`). A value of the model that is beyond may stay.
    """
    at = simulator.values([], {name: values for name, values in model.items() if name in simulator.effect_names})
    n = simulator.n_initial_states
    lower, upper = np.full(len(at), -np.inf), np.full(len(at), np.inf)
    beyond = 1 + TAIL_SHARE * math.sqrt(MIN_EVIDENCE_AGAINST)
    for i, spec in enumerate(simulator.parameters[n:], start=n):
        limit = limit_of(spec, rig)
        reach = math.inf if limit is None else beyond * limit
        lower[i] = min(0.0, max(spec.lower, spec.neutral - reach) - at[i])
        upper[i] = max(0.0, min(spec.upper, spec.neutral + reach) - at[i])
    return lower, upper


def distance_within(target: Array, columns: Array, lower: Array, upper: Array) -> float:
    """Distance of a target (m,) from what columns (m, k) reach with coefficients between lower and upper (k,)."""
    norms = np.linalg.norm(columns, axis=0)
    able = (norms > 0) & (lower < upper)
    if not able.any():
        return float(np.linalg.norm(target))
    scale = norms[able]
    # In the basis of the columns the problem has as many rows as unknowns; what is orthogonal to them stays.
    basis, triangle = np.linalg.qr(columns[:, able] / scale)
    inside = basis.T @ target
    found = lsq_linear(triangle, inside, (lower[able] * scale, upper[able] * scale), method="bvls")
    return float(np.hypot(np.linalg.norm(target - basis @ inside), np.linalg.norm(found.fun)))


def _project_recording(simulator: Simulator, rig: TwinRig, model: EffectValues, recording: FittedRecording) -> Array:
    """Sensitivities in sigma of one recording by the simulator's values, its own nuisances projected out, shape (3 n, values)."""
    o = recording.observations
    acting = {
        name: EFFECTS[name].shift_start(values, o.offset_s) if name not in model else values
        for name, values in {**recording.model_effects, **model}.items()
    }
    own = Simulator(rig, sorted({*simulator.effect_names, *acting}))
    at = own.values(recording.initial, acting)
    flat = sensitivities_sigma(own, at, o).reshape(-1, len(own.parameters))
    nuisances = [i for i, spec in enumerate(own.parameters) if spec.refitted]
    if not recording.heading_is_fitted:
        nuisances.remove(HEADING)
    basis = orthonormal(flat[:, nuisances])
    place_of = {spec.label: i for i, spec in enumerate(own.parameters)}
    flat = flat[:, [place_of[spec.label] for spec in simulator.parameters]]
    return project_out(basis, flat)


def _places(specs: Sequence[ParameterSpec], names: Iterable[str]) -> list[int]:
    chosen = set(names)
    return [i for i, spec in enumerate(specs) if spec.effect in chosen]


MAX_EXCESS_RATIO = 1.25
"""Excess over that of the best set up to which another one, whose values parts can have, is the better answer."""


def leaves_no_more(found: float, best: float) -> bool:
    """Whether a reduced chi-square leaves as little as the best, or so little more that what parts can have is better."""
    return found - 1 < MAX_EXCESS_RATIO * max(best - 1, EXCESS_SIGNIFICANT)


def contributions(context: SearchContext, validator: Validator, best: CandidateFit) -> Contributions:
    """What the effects of a fitted set contribute to the log and to the selection part together."""
    setting, n = context.setting, context.setting.simulator(best.names).n_initial_states
    validation = validator.evaluate(best)
    recordings = (
        FittedRecording(
            setting.log,
            {**setting.model_effects, **best.crane_inputs},
            best.fit.values[:n],
            heading_is_fitted=False,
            excess_chi2=excess_chi2(setting.log, best.fit),
        ),
        FittedRecording(
            validator.selection,
            validator.effects_of(best),
            validation.fit.values[:n],
            heading_is_fitted=is_world_directed({*best.names, *setting.model_effects}),
            excess_chi2=excess_chi2(validator.selection, validation.fit),
        ),
    )
    return find_contributions(setting.rig, setting.stated_effects, best.values, scorable_effects(setting), recordings)


def replace_implausible(
    table: CandidateTable, context: SearchContext, validator: Validator, best: CandidateFit
) -> tuple[CandidateTable, CandidateFit]:
    """Return the set with effects of the same signature in place of those that need a value no part has.

    Where a remainder makes two effects alike, what their fits leave decides nothing between them, and the prior does. The sets
    with such a value are then no rivals.
    """
    for name in sorted(best.names - set(context.baseline_effects)):
        if not is_beyond_parts(name, best, context):
            continue
        rest = best.without(name)
        starts = context.segment_starts(best)
        partners = sorted(contributions(context, validator, best).alike(name))
        for other in partners:
            requests = context.requests(table, rest, other, context.guesses(other, best), starts)
            table = context.fit_in_turn(table, requests)
        fits = (table.get({*rest, other}) for other in partners)
        alike = [fit for fit in fits if fit is not None and leaves_no_more(fit.reduced_chi2, best.reduced_chi2)]
        if alike:
            kept = {
                names: fit
                for names, fit in table.fits.items()
                if name not in names or not is_beyond_parts(name, fit, context)
            }
            moves = tuple(move for move in table.moves if move.names in kept)
            table, replaced = replace(table, fits=kept, moves=moves), best
            best = min(alike, key=table.bic)
            table = table.record_move(replaced, best)
    return table, best


def is_beyond_parts(name: str, fit: CandidateFit, context: SearchContext) -> bool:
    """Return whether an effect needs a value that no part has."""
    doubt = implausibility({name: fit.values[name]}, context.setting.rig)
    return doubt > MIN_EVIDENCE_AGAINST
