"""How far the load swings: the four published formulas, and a likelihood fit of the pendulum with its uncertainty."""

from gateway.swing.estimate import FormulaAngles, SwingEstimate, SwingPeak
from gateway.swing.formulas import VALID_RHO, Extremes, LowpassGain, as_published, corrected, extremes
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing

__all__ = [
    "VALID_RHO",
    "Extremes",
    "FormulaAngles",
    "LowpassGain",
    "MountedHousing",
    "SwingEstimate",
    "SwingPeak",
    "as_published",
    "corrected",
    "estimate_swing",
    "extremes",
]
