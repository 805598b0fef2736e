"""Ctrl-C is held back while a library that loses it is at work, and is never lost."""

import contextlib
import signal
from collections.abc import Iterator

import pytest

from gateway.cli.progress import DeferredInterrupt, Progress
from tests.gateway.cli.terminal import TerminalText


@pytest.fixture(autouse=True)
def _default_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _press_and_check(presses: int) -> list[int]:
    """Presses that were held back."""
    held = []
    with contextlib.suppress(KeyboardInterrupt), DeferredInterrupt() as interrupt:
        for number in range(presses):
            interrupt.check()
            signal.raise_signal(signal.SIGINT)
            held.append(number)
    return held


def test_an_interrupt_is_raised_at_the_next_check() -> None:
    assert _press_and_check(5) == [0]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_without_a_check_is_raised_at_the_end() -> None:
    with pytest.raises(KeyboardInterrupt), DeferredInterrupt():
        signal.raise_signal(signal.SIGINT)


def test_a_second_interrupt_acts_at_once() -> None:
    held = []
    with contextlib.suppress(KeyboardInterrupt), DeferredInterrupt():
        for number in range(5):
            signal.raise_signal(signal.SIGINT)
            held.append(number)
    assert held == [0]


def test_an_ignored_interrupt_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with DeferredInterrupt() as interrupt:
        signal.raise_signal(signal.SIGINT)
        interrupt.check()
    assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN


def test_where_an_answer_so_far_can_be_given_ctrl_c_asks_for_it_and_a_second_one_stops() -> None:
    stream = TerminalText()
    with Progress(stream, best_so_far=True) as progress:
        signal.raise_signal(signal.SIGINT)
        progress.tick("search", 0.5)
        assert progress.is_interrupted
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):  # where a library has swallowed it
            progress.tick("search", 0.6)
    assert "Ctrl-C again stops without one" in stream.getvalue()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
