"""The errors that a person reads: one line with the place and the remedy, and an exit code; and text as a terminal shows it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import ValidationError


ANSWER_IS_NO, BAD_INPUT, WITH_LOSSES = 1, 2, 3
"""Exit codes of the commands: refused, different or failed; wrong usage or input; done, but something was lost or is damaged.
Definition: `docs/reference/commands.md`."""


class PlumblineError(Exception):
    """An error that the user can remedy; the text states what, where and how, in one line."""

    exit_code = BAD_INPUT


class InputError(PlumblineError, ValueError):
    """Bad input to a command: a file, an option, a recording."""


_ALLOWED: dict[str, str] = {}
"""What a pattern allows, in words."""


def pattern_of(pattern: str, allowed: str) -> str:
    """Return a pattern; where a text does not match it, `describe_problem` says what is allowed, in words."""
    _ALLOWED[pattern] = allowed
    return pattern


def describe_problems(error: "ValidationError", whole: str = "content") -> list[str]:
    """Return the problems of a validation as "place: what is wrong"; `whole` is the place of one without a field."""
    problems = error.errors(include_url=False)
    places = [".".join(map(str, problem["loc"])) or whole for problem in problems]
    return [f"{place}: {describe_problem(problem)}" for place, problem in zip(places, problems, strict=True)]


def describe_problem(problem: Mapping[str, Any]) -> str:
    """Return what is wrong by a problem of pydantic."""
    allowed = _ALLOWED.get(problem.get("ctx", {}).get("pattern", ""))
    return f"should be {allowed}" if allowed else str(problem["msg"]).removeprefix("Value error, ")


def printable(text: str) -> str:
    """Return a text with every character escaped that steers a terminal, reverses the direction of text or begins a line."""
    return "".join(character if character.isprintable() else ascii(character)[1:-1] for character in text)


def first_of(texts: Sequence[str], shown: int, joined: str = ", ") -> str:
    """Return the first texts of a list, and how many others there are."""
    more = [f"{len(texts) - shown} more"] if len(texts) > shown else []
    return " and ".join([joined.join(texts[:shown]), *more])


def counted(number: int, thing: str) -> str:
    """Return a number with what it counts: "1 gap", "2 gaps"."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
