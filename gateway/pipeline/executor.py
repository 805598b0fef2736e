"""Where the pipeline's long computations run: in the caller's thread or in another one, with the same results."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, ParamSpec, Protocol, TypeVar

P = ParamSpec("P")
T_co = TypeVar("T_co", covariant=True)
T = TypeVar("T")


class Future(Protocol[T_co]):
    """The result of a computation that may still run, such as a `concurrent.futures.Future`."""

    def result(self) -> T_co:
        """Return the result; wait for it if necessary."""
        ...


class Executor(Protocol):
    """Runs computations in the order of their submission, such as a `ThreadPoolExecutor` with one worker."""

    def submit(self, work: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Start a computation."""
        ...


@dataclass(frozen=True, slots=True)
class CompletedFuture(Generic[T]):
    """The result of a computation that has ended."""

    value: T

    def result(self) -> T:
        """Return the result."""
        return self.value


class ImmediateExecutor:
    """Runs each computation in the caller's thread: for replays, tests and benchmarks."""

    def submit(self, work: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> CompletedFuture[T]:
        """Run a computation."""
        return CompletedFuture(work(*args, **kwargs))
