"""How far the load swings: the four published formulas, and a likelihood fit of the pendulum with its uncertainty."""

from gateway.swing.estimate import FormulaAngles, PeakPrediction, SwingEstimate, SwingPeak
from gateway.swing.formulas import VALID_RHO, Extremes, Passage, corrected, extremes, published
from gateway.swing.live import SwingTracker
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing

__all__ = [
    "VALID_RHO",
    "Extremes",
    "FormulaAngles",
    "MountedHousing",
    "Passage",
    "PeakPrediction",
    "SwingEstimate",
    "SwingPeak",
    "SwingTracker",
    "corrected",
    "estimate_swing",
    "extremes",
    "published",
]
