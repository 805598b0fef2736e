"""Where the long work of the pipeline is done: at once, or beside it. The answers and their places are the same either way."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, ParamSpec, Protocol, TypeVar

P = ParamSpec("P")
T_co = TypeVar("T_co", covariant=True)
T = TypeVar("T")


class Answer(Protocol[T_co]):
    """What will have been found; `concurrent.futures.Future` is one."""

    def result(self) -> T_co:
        """The answer, waited for where it is not there yet."""
        ...


class Executor(Protocol):
    """Does pieces of work in the order in which they come; a `concurrent.futures` executor of one worker is one."""

    def submit(self, work: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Answer[T]:
        """Take a piece of work."""
        ...


@dataclass(frozen=True, slots=True)
class CompletedFuture(Generic[T]):
    """An answer that is there."""

    answer: T

    def result(self) -> T:
        """The answer."""
        return self.answer


class ImmediateExecutor:
    """Works in the caller's thread: for replays, tests and benchmarks."""

    def submit(self, work: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> CompletedFuture[T]:
        """Do the work now."""
        return CompletedFuture(work(*args, **kwargs))
