"""The budget of a search: how many fits, how much integration and time it may spend, and in how many processes."""

from collections.abc import Callable
from dataclasses import dataclass

from gateway.twin.simulator.compiled_model import IntegrationError

MAX_FITS = 60
"""Fits after which what is still missing is no single effect and no pair: searches that end with a name make 10 to 45."""
MAX_WORK = 1.6e8
"""Derivatives of states and readings in fits, some 20 s on one core of a desk; searches that end with a name spend half of it."""


class OutOfTimeError(IntegrationError):
    """The search is over: the fit that runs is given up like one that diverges."""


@dataclass(slots=True)
class Budget:
    """Counts what a search has spent; the same recording and rig always spend the same, unless it is ended early."""

    max_fits: int = MAX_FITS
    max_work: float = MAX_WORK
    processes: int = 1
    """Processes for fits that do not depend on each other."""
    is_over: Callable[[], bool] = lambda: False
    """Whether somebody wants the best answer so far."""
    fits: int = 0
    work: float = 0.0
    work_per_evaluation: float = 0.0
    work_of_fit: float = 0.0
    """Of the fit that is running, or ended last."""

    @property
    def is_exhausted(self) -> bool:
        """Whether the search has to end with what it has."""
        return self.fits >= self.max_fits or self.work >= self.max_work or self.is_over()

    @property
    def spent_share(self) -> float:
        """Share of the budget that is spent, 0 to 1; most searches end before it is 1."""
        return min(max(self.fits / self.max_fits, (self.work + self.work_of_fit) / self.max_work), 1.0)

    def begin_fit(self, work_per_evaluation: float) -> None:
        """Note what each evaluation of a fit costs. Raises `OutOfTimeError` as `count_evaluation` does."""
        self._end_if_over()
        self.work_per_evaluation, self.work_of_fit = work_per_evaluation, 0.0

    def count_evaluation(self) -> None:
        """Count one linearisation of the model. Raises `OutOfTimeError` where the search is over and has an answer."""
        self._end_if_over()
        self.work_of_fit += self.work_per_evaluation

    def add_fit(self, work: float) -> None:
        """Count a fit that the search used."""
        self.fits += 1
        self.work += work

    def _end_if_over(self) -> None:
        if self.fits and self.is_over():
            raise OutOfTimeError
