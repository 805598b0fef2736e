"""From bins to the fit that is believed: spikes left out, disturbed axes weighted down, and the rig doubted where it must be."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.robust import robust_sigma
from gateway.swing.data.bins import Bins
from gateway.swing.fit.likelihood import Fit, improved, linearised, maximum_a_posteriori, reweighted
from gateway.swing.fit.priors import Prior, SensorModel
from gateway.swing.model.motion import PLAIN, STATES, Motion
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.uncertainty.peaks import largest_angle
from gateway.swing.uncertainty.uncertainty_model import LARGEST_MISFIT, UncertaintyModel, misfit, uncertainty_of

SPIKE_SIGMA = 6.0
MOST_SPIKES = 0.03
"""Share of the bins; more than that are not spikes but something that the pendulum does not know."""
UNEVEN = 1.5
"""Inflation of an axis' variance from which on it is weighted down."""
HOPELESS = 3.0
"""Times the largest misfit, from which on other weights or more iterations do not mend a fit."""
OUTDONE = 10.0
"""Times the chi-square of another start's fit, from which on a fit that hardly improves is given up."""
NEGLIGIBLE_MISFIT = 0.003
"""Unexplained part of the signal up to which the rig as stated is not doubted: it costs more than it mends."""
EXPLAINED = 1.3
"""Reduced chi-square at which no other start is tried."""
DEMANDED = 3.0
"""Standard uncertainties that an error must have to be named."""
MOST_EXPLANATIONS = 4
INCREDIBLE = 4.0
"""Prior standard deviations beyond which an error of the rig is no explanation."""
REFIT_ITERATIONS = 12


@dataclass(frozen=True, slots=True)
class FitResult:
    """A fit, what it supports, and why it is not the plain one."""

    fit: Fit
    claim: UncertaintyModel
    widening: float = 1.0
    """By which the noise would have had to be larger to explain the residual."""
    spikes: int = 0
    """Bins left out."""
    explained_by: tuple[str, ...] = ()
    """Errors of the rig or sensor that the data demand."""

    @property
    def sound(self) -> bool:
        """An uncertainty may be stated."""
        return self.fit.converged and self.claim.describes

    @property
    def plain(self) -> bool:
        """Noise explains the residual, or all of it that matters."""
        return self.fit.converged and self.claim.misfit < NEGLIGIBLE_MISFIT


def fit_robust(
    bins: Bins,
    noise_g: Real,
    motion: Motion,
    beliefs: Prior,
    iterations: int,
    instrument: SensorModel | None = None,
    *,
    worth: float = LARGEST_MISFIT,
) -> FitResult | None:
    """The fit of a window; None when the motion leaves the model.

    `worth`: unexplained part of the signal up to which the caller has a use for it; one that stays far above is given up early.
    """
    weight = bins.count[:, None] / noise_g**2
    fit = linearised(bins, weight, motion, beliefs, instrument)
    return None if fit is None else _finding(improved(fit, iterations, _hopeless(weight, worth)), weight)


def fit_robust_from(
    bins: Bins,
    noise_g: Real,
    starts: list[Motion],
    beliefs: Prior,
    iterations: int,
    *,
    worth: float = LARGEST_MISFIT,
) -> FitResult | None:
    """The fit from the most promising of several starts, the nearest first; the first that noise explains is taken at once."""
    weight = bins.count[:, None] / noise_g**2
    motions = [start.with_parameters(beliefs.parameters) for start in starts]
    fits = [fit for motion in motions if (fit := linearised(bins, weight, motion, beliefs)) is not None]
    near = OUTDONE * min((fit.cost for fit in fits), default=0.0)
    best: Fit | None = None
    for fit in sorted((fit for fit in fits if fit.cost <= near), key=lambda fit: fit.cost) if len(fits) > 1 else []:
        trial = improved(fit, max(iterations // 2, 1), _hopeless(weight, worth, best))
        best = trial if best is None or trial.cost < best.cost else best
        if best.cost < EXPLAINED * weight.size:
            break
    best = best or next(iter(fits), None)
    if best is None:
        return None
    return _finding(best if best.converged else improved(best, iterations, _hopeless(weight, worth)), weight)


def _hopeless(weight: Real, worth: float, rival: Fit | None = None) -> Callable[[Fit], bool]:
    """Whether a fit that hardly improves any more is given up: far from being of use, or from the best so far."""

    def given_up(fit: Fit) -> bool:
        return (rival is not None and fit.cost > OUTDONE * rival.cost) or misfit(fit, weight) > HOPELESS * worth

    return given_up


def _finding(fit: Fit, weight: Real) -> FitResult | None:
    """What a fit supports, after spikes are left out and uneven axes weighted down; `weight` is by sensor noise alone."""
    spiky = _spikes(fit) & fit.converged
    if spiky.any():
        bins, weight = fit.bins.select(~spiky), weight[~spiky]
        without = maximum_a_posteriori(bins, weight, fit.motion, fit.beliefs, REFIT_ITERATIONS, fit.instrument)
        if without is None:
            return None
        fit = without
    found = uncertainty_of(fit, weight)
    widening = float(np.sqrt(found.inflation.max()))
    if widening**2 > UNEVEN and fit.converged and found.misfit < HOPELESS * LARGEST_MISFIT:
        fit = improved(reweighted(fit, weight / found.inflation), REFIT_ITERATIONS)
        found = uncertainty_of(fit, weight)
    return FitResult(fit, found, widening, int(spiky.sum()))


def choose_prior(plain: FitResult | None, doubting: FitResult | None) -> FitResult | None:
    """Of a fit that takes the rig as stated and one that doubts it, the one to believe."""
    if doubting is None or not doubting.sound or not _credible(doubting.fit):
        return plain
    if plain is not None and plain.sound and _deviation(plain) < _deviation(doubting):
        return _widened_by(plain, doubting)
    return replace(doubting, explained_by=_significant_errors(doubting))


def _widened_by(plain: FitResult, doubting: FitResult) -> FitResult:
    """The fit under the rig as stated, with what the other one says of the angle in its uncertainty."""
    angle_rad, other_rad = (largest_angle(each.fit, each.claim)[0] for each in (plain, doubting))
    return inflate_uncertainty(plain, abs(other_rad / angle_rad - 1))


def inflate_uncertainty(finding: FitResult, angle_u_rel: float) -> FitResult:
    """With a further relative uncertainty of its angles."""
    u_rel = float(np.hypot(finding.claim.other_u_rel, angle_u_rel))
    return replace(finding, claim=replace(finding.claim, other_u_rel=u_rel))


def choose_fit(first: FitResult | None, second: FitResult | None) -> FitResult | None:
    """Of two fits under the same beliefs, the one that settled and leaves less of the signal."""
    if second is None or not second.fit.converged:
        return first
    if first is None or not first.fit.converged or second.claim.misfit < first.claim.misfit:
        return second
    return first


def _spikes(fit: Fit) -> NDArray[np.bool_]:
    """Few, lone bins far from all others."""
    size = np.abs(fit.residual_g) * np.sqrt(fit.weight)
    usual = np.maximum(robust_sigma(size), 1.0)
    spiky: NDArray[np.bool_] = np.any(size > SPIKE_SIGMA * usual, axis=1)
    few = np.count_nonzero(spiky) <= max(MOST_SPIKES * len(size), 1)
    return spiky & few


def _deviation(finding: FitResult) -> float:
    """Standard uncertainty of the largest angle."""
    return largest_angle(finding.fit, finding.claim)[1]


def _credible(fit: Fit) -> bool:
    """No error of the instrument is far outside what such errors can be."""
    prior = fit.beliefs.deviation[STATES + len(fit.motion.parameters) :]
    return bool((np.abs(fit.instrument.errors) <= INCREDIBLE * prior).all())


def _significant_errors(finding: FitResult) -> tuple[str, ...]:
    """What the data demand beyond the rig as stated, the surest first."""
    fit = finding.fit
    found = np.concatenate([fit.motion.parameters[PLAIN:], fit.instrument.errors])
    deviation = np.sqrt(np.diag(finding.claim.covariance))[-len(found) :]
    surest = np.argsort(-np.abs(found) / deviation)[:MOST_EXPLANATIONS]
    named = tuple(_explanations(found)[i] for i in surest if abs(found[i]) > DEMANDED * deviation[i])
    return named or ("several small errors together",)


def _explanations(found: Real) -> list[str]:
    """Drag, spin, position, offsets and matrix in words."""
    drag, spin_1_s, position_m, *rest = found
    offsets = [f"{axis} zero-g offset {1e3 * g:+.1f} mg" for axis, g in zip("xyz", rest[:3], strict=True)]
    entries = [(row, column) for row in "xyz" for column in "xyz"]
    matrix = [
        f"{f'scale of {row}' if row == column else f'{column} into {row}'} {100 * error:+.2f} %"
        for (row, column), error in zip(entries, rest[3:], strict=True)
    ]
    return [
        f"quadratic drag {drag:+.3f}",
        f"housing turning {np.degrees(spin_1_s):+.2f} deg/s",
        f"housing {position_m:+.2f} m along the rope",
        *offsets,
        *matrix,
    ]
