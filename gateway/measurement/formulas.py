"""The four formulas of Łuczak et al. 2022 over a recording and over each of its swings, as published and corrected."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.measurement.source import Source
from gateway.stages.lowpass import LowPass
from gateway.swing.estimate import FormulaAngles, SwingEstimate
from gateway.swing.formulas import LowpassGain, as_published, corrected, extremes

NO_ANGLES = FormulaAngles(arccos_min_az=None, arcsin_max_axy=None, arctan_max_axy_min_az=None, arccos_max_az=None)


@dataclass(frozen=True, slots=True)
class FormulaResult:
    """The angles by the formulas over one interval."""

    as_published: FormulaAngles
    corrected: FormulaAngles
    """Corrected for rho and for the attenuation of the low-pass; empty where the position of the housing or the period is not
    known."""


@dataclass(frozen=True, slots=True)
class FormulaEvaluation:
    """Evaluates the formulas on intervals of one recording after the low-pass."""

    source: Source
    lowpass: LowPass
    lowpassed_g: NDArray[np.float64]
    """Specific force after the low-pass, shape (n, 3)."""
    swing: SwingEstimate

    def whole_recording(self) -> FormulaResult:
        """Return the result over all samples."""
        return self._evaluate(self.lowpassed_g)

    def each_swing(self) -> tuple[FormulaResult, ...]:
        """Return the result over one period around each maximum of the swing, shifted by the delay of the low-pass."""
        period_s = self.swing.period_s
        if period_s is None:
            return ()
        middles_s = np.array([peak.time_s for peak in self.swing.swings]) + self.lowpass.delay_s(1 / period_s)
        halves_s = np.array([[-0.5], [0.5]]) * period_s
        bounds = np.searchsorted(self.source.recording.time_s, middles_s + halves_s).T
        return tuple(self._evaluate(self.lowpassed_g[start:stop]) for start, stop in bounds)

    def _evaluate(self, lowpassed_g: NDArray[np.float64]) -> FormulaResult:
        found = extremes(lowpassed_g)
        if found is None:
            return FormulaResult(NO_ANGLES, NO_ANGLES)
        housing, swing, lowpass = self.source.housing, self.swing, self.lowpass
        if housing is None or swing.length_m is None or swing.period_s is None:
            return FormulaResult(as_published(found), NO_ANGLES)
        gain = LowpassGain(gain_f0=lowpass.gain(1 / swing.period_s), gain_2f0=lowpass.gain(2 / swing.period_s))
        return FormulaResult(as_published(found), corrected(found, housing.rho_at(swing.length_m), gain))
