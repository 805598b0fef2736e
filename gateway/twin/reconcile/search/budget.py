"""The budget of a search: how many fits, and how much integration, it may spend, and in how many processes."""

from dataclasses import dataclass

MAX_FITS = 60
"""Fits after which what is still missing is no single effect and no pair: searches that end with a name make 10 to 45."""
MAX_WORK = 1.6e8
"""Derivatives of states and readings in fits, some 20 s on one core of a desk; searches that end with a name spend half of it."""


@dataclass(slots=True)
class Budget:
    """Counts what a search has spent; the same recording and rig always spend the same."""

    max_fits: int = MAX_FITS
    max_work: float = MAX_WORK
    processes: int = 1
    """Processes for fits that do not depend on each other."""
    fits: int = 0
    work: float = 0.0
    work_per_evaluation: float = 0.0
    """Of the fit that is running."""

    @property
    def is_exhausted(self) -> bool:
        """Whether the search has to end with what it has."""
        return self.fits >= self.max_fits or self.work >= self.max_work

    @property
    def spent_share(self) -> float:
        """Share of the budget that is spent, 0 to 1; most searches end before it is 1."""
        return min(max(self.fits / self.max_fits, self.work / self.max_work), 1.0)

    def begin_fit(self, work_per_evaluation: float) -> None:
        """Count a fit; each of its evaluations costs this much work."""
        self.fits += 1
        self.work_per_evaluation = work_per_evaluation

    def count_evaluation(self) -> None:
        """Count one linearisation of the model."""
        self.work += self.work_per_evaluation

    def add_fit(self, work: float) -> None:
        """Count a fit that was made elsewhere."""
        self.fits += 1
        self.work += work
