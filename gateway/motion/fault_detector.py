"""Detection of sensor faults that no motion of a load explains, in the newest readings of a live stream."""

from collections import deque

import numpy as np

from gateway.messages.header import Reason, ReasonCode
from gateway.motion.binning import Binning, BinNoise, ForceBin
from gateway.numerics.array import Array
from gateway.swing.data.bins import BINS_PER_PERIOD, Bins
from gateway.swing.data.input_checks import find_constant_axis, find_implausible_mean
from gateway.swing.detection.dead_axis import WINDOW_PERIODS, DeadAxis, compare_axes, contradiction_u_rel
from gateway.swing.fit.harmonics import refine_harmonics
from gateway.swing.rig import MountedHousing

CONSTANT_S = 3.0
"""Time for which an axis must be constant to be dead. Basis: an axis with noise of a tenth of its step changes within it."""
FEWEST_BINS = BINS_PER_PERIOD // 2
"""Bins before which nothing is judged. Basis: the axial force of a swing repeats after half a period."""
CHECK_EVERY_BINS = BINS_PER_PERIOD // 3
PERSISTENT = 3
"""Checks in a row that must find an axis silent: one period."""


class FaultDetector:
    """Keeps means of the last periods and looks for faults in them."""

    def __init__(self, rig: MountedHousing) -> None:
        self._rig = rig
        self._is_on_rope = rig.possible_structures == ["rope"]
        """The axes belong together as on a single rope; on a spreader or one of several ropes x and y read less of a swing."""
        self._bin_s = rig.small_swing_period_s / BINS_PER_PERIOD
        self._binning = Binning(self._bin_s)
        self._bins: deque[ForceBin] = deque(maxlen=round(WINDOW_PERIODS * BINS_PER_PERIOD))
        self._noise = BinNoise()
        self._since_check = 0
        self._axes: deque[DeadAxis] = deque(maxlen=PERSISTENT)
        self._contradictions: deque[float] = deque(maxlen=PERSISTENT)
        """Relative uncertainty of the angle because the axes contradict each other, of the last checks."""
        self.fault: Reason | None = None
        """What is wrong; None: nothing is known to be."""

    @property
    def is_ready(self) -> bool:
        """Whether there are enough readings to judge."""
        return len(self._bins) >= FEWEST_BINS

    @property
    def contradiction_u_rel(self) -> float:
        """Relative uncertainty of the angle because the axes contradict each other throughout a period; 0: they agree."""
        return min(self._contradictions) if len(self._contradictions) == PERSISTENT else 0.0

    @property
    def undecided_u_rel(self) -> float:
        """Relative uncertainty of the angle where the readings do not decide whether an axis is dead."""
        return self._axes[-1].angle_u_rel if self._axes else 0.0

    def update(self, time_s: Array, force_g: Array) -> None:
        """Take a block, shapes (n,) and (n, 3)."""
        complete = self._binning.add(time_s, force_g)
        for one in complete:
            if self._bins and one.time_s - self._bins[-1].time_s > BINS_PER_PERIOD * self._bin_s:
                self._bins.clear()  # after a gap of a period nothing relates the two sides
                self._noise.clear()
                self._axes.clear()
                self._contradictions.clear()
            self._noise.add(one.force_g)
            self._bins.append(one)
        if complete and self.is_ready:
            self._since_check += len(complete)
            self._check()

    def _check(self) -> None:
        means_g = np.concatenate([one.force_g for one in self._bins]).reshape(-1, 3)
        last = max(2, round(CONSTANT_S / self._bin_s))
        constant = find_constant_axis(means_g[-last:]) if len(self._bins) >= last else None
        if self._since_check >= CHECK_EVERY_BINS:
            self._since_check = 0
            self._check_axes(means_g)
        found: tuple[tuple[ReasonCode, str | None], ...] = (
            ("axis_constant", constant),
            ("implausible_mean", find_implausible_mean(means_g[-BINS_PER_PERIOD:])),
            ("axis_silent", self._silent_axis),
        )
        self.fault = next((Reason(code, words) for code, words in found if words), None)

    def _check_axes(self, means_g: Array) -> None:
        """Look for an axis that shows nothing of a swing that the others show."""
        if len(self._bins) < BINS_PER_PERIOD or not self._is_on_rope:
            return
        time_s = np.array([one.time_s for one in self._bins])
        count = np.array([float(one.count) for one in self._bins])
        bins = Bins(time_s, np.full(len(time_s), self._bin_s / np.sqrt(12)), means_g, count)
        noise_g = self._noise.sigma_g(0.0) * np.sqrt(count.mean())
        # the rope's length by the frequency, which no dead axis changes; that of the filter may be wrong then
        harmonics, length_m = refine_harmonics(bins, noise_g, self._rig)
        self._axes.append(compare_axes(harmonics, self._rig, length_m))
        self._contradictions.append(contradiction_u_rel(harmonics, self._rig, length_m))

    @property
    def _silent_axis(self) -> str | None:
        """The axis that shows nothing throughout a period."""
        faults = [axes.fault for axes in self._axes]
        return faults[-1] if len(faults) == PERSISTENT and all(faults) else None
