"""How far the load swings: the four published formulas, and a likelihood fit of the pendulum with its uncertainty."""

from gateway.stages.swing.estimate import FormulaAngles, PeakPrediction, SwingEstimate, SwingPeak
from gateway.stages.swing.formulas import VALID_RHO, Extremes, Passage, corrected, extremes, published
from gateway.stages.swing.live import SwingTracker
from gateway.stages.swing.recording import estimate_swing
from gateway.stages.swing.rig import MountedHousing

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
