"""How the readings answer to each effect, what it could take off the residual, and which effects look alike.

A signature has nuisance parameters projected out. The score test asks what each effect could take off the residual, from one
linearisation of the model with all of them at rest (Rao 1948): the gradient of the likelihood by an effect's parameters where the
effect is absent, projected off what is fitted anyway, over its own covariance. Isolability is the angle between two signatures.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Values
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import NO_SHAPES, FitContext, sensitivities_sigma
from gateway.twin.reconcile.fit.initial_states import window_bounds
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
RANK_TOLERANCE = 1e-7
"""Singular value, relative to the largest, below which columns are linearly dependent up to rounding."""


def orthonormal(columns: Array) -> Array:
    """Return an orthonormal basis of the space that columns (m, k) span, shape (m, rank)."""
    norms = np.linalg.norm(columns, axis=0)
    scaled: Array = columns[:, norms > 0] / norms[norms > 0]
    if not scaled.shape[1]:
        return scaled
    left, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    return left[:, singular > RANK_TOLERANCE * singular[0]]


def project_out(basis: Array, columns: Array) -> Array:
    """Return what of columns (m,) or (m, k) is orthogonal to an orthonormal basis (m, rank)."""
    return columns - basis @ (basis.T @ columns)


@dataclass(frozen=True, slots=True)
class Signatures:
    """How the readings answer to each effect, the nuisances and the model's own parameters projected out."""

    residual: Array
    """Sigma, projected, shape (3 n,)."""
    of: Mapping[str, Array]
    """Effect -> projected columns in sigma, shape (3 n, parameters)."""
    stated: frozenset[str] = frozenset()
    """Effects that the rig states: of these the change is asked, which may have any sign."""

    def predicted_chi2_drop(self, name: str) -> float:
        """By how much chi-square would fall, as if the effect were linear; signs of one-sided parameters are kept."""
        columns = self.of[name]
        solved, *_ = np.linalg.lstsq(columns, self.residual, rcond=1e-9)
        lower = np.array([p.lower for p in EFFECTS[name].parameters])
        if name not in self.stated and columns.shape[1] == 1 and lower[0] == 0 and solved[0] < 0:
            return 0.0
        fitted = columns @ solved
        return float(fitted @ self.residual)


def compute_signatures(
    setting: FitContext,
    fit: Fit,
    values: EffectValues,
    names: Sequence[str],
    shapes: EffectValues = NO_SHAPES,
    segment_starts: Array | None = None,
) -> Signatures:
    """Of effects that are smooth where they vanish, beside a fitted model.

    `shapes` are the values of parameters that do not make an effect vanish, such as a frequency, where they are not the neutral
    ones. `segment_starts` are the initial states of a large swing's windows under the model, where they are known.
    """
    own = frozenset(values)
    tried = [n for n in names if n not in own]
    simulator, at = setting.at_rest_beside(fit, values, tried, shapes)
    o = setting.log
    if o.has_large_amplitude:
        fitted = {name: each for name, each in simulator.effects(at).items() if name not in tried}
        starts = setting.segment_starts(fitted) if segment_starts is None else segment_starts
        found = _signatures_by_window(simulator, o, starts, at[simulator.n_initial_states :], own, tried)
        return replace(found, stated=frozenset(setting.stated_effects))
    flat = sensitivities_sigma(simulator, at, o).reshape(-1, len(simulator.parameters))
    nuisance = [
        i
        for i, slot in enumerate(simulator.parameters)
        if (slot.effect in own or (slot.refitted and slot.effect not in tried)) and i != HEADING
    ]
    basis = orthonormal(flat[:, nuisance])
    residual = o.residual_sigma(fit.force_g).ravel()
    of = {}
    for name in tried:
        columns = flat[:, [i for i, slot in enumerate(simulator.parameters) if slot.effect == name]]
        of[name] = project_out(basis, columns)
    return Signatures(project_out(basis, residual), of, frozenset(setting.stated_effects))


def scorable_effects(setting: FitContext) -> tuple[str, ...]:
    """Lasting effects that the recording could show: without a temperature none shows a drift by it."""
    has_temperature = setting.log.temperature_c is not None
    return tuple(n for n in EFFECTS.choose(is_scored=True) if has_temperature or not EFFECTS[n].needs_temperature)


def _signatures_by_window(
    simulator: Simulator,
    observations: Observations,
    starts: Array,
    effects: Array,
    own: frozenset[str],
    tried: Sequence[str],
) -> Signatures:
    """Of a wide swing: a model that lacks something cannot follow it as one motion, but each piece of it for itself.

    The windows begin at the `starts` of the model without the effects that are scored; these vanish there.
    """
    firsts = window_bounds(simulator.rig, observations)
    time_s, temperature_c = observations.time_s, observations.temperature_c
    found = simulator.linearise_segments(starts, effects, time_s, firsts, temperature_c)
    by_state = np.delete(found.force_by_start, HEADING, axis=2) * observations.per_sigma[..., None]
    columns = found.force_by_effects * observations.per_sigma[..., None]
    residual = observations.residual_sigma(found.force_g)
    for window in map(slice, firsts, [*firsts[1:], len(residual)]):
        basis = orthonormal(by_state[window].reshape(-1, by_state.shape[2]))
        columns[window] = project_out(basis, columns[window].reshape(len(basis), -1)).reshape(columns[window].shape)
        residual[window] = project_out(basis, residual[window].ravel()).reshape(-1, 3)
    columns, residual = columns.reshape(-1, columns.shape[2]), residual.ravel()
    places = {
        name: [i for i, s in enumerate(simulator.effect_parameters) if s.effect == name]
        for name in simulator.effect_names
    }
    basis = orthonormal(columns[:, [i for name in sorted(own) for i in places[name]]])
    of = {name: project_out(basis, columns[:, places[name]]) for name in tried}
    return Signatures(project_out(basis, residual), of)


def any_length_changes(names: Iterable[str]) -> bool:
    """Whether one of these effects changes the rope's length, which separates effects that coincide otherwise."""
    return any(EFFECTS[name].changes_length for name in names)


def coincident_effects(model: EffectValues, length_m: float) -> Iterator[tuple[str, str, Values]]:
    """Yield effects that can give the same samples as one of a model: their names, its name, and their parameters."""
    for name, effect in EFFECTS.items():
        of = effect.coincides_with
        if of is None or of not in model or name in model:
            continue
        values = effect.equivalent_values(model[of], length_m)
        if values is not None:
            yield name, of, values
