"""The search for tuned numbers, their movement on import, and what counts as an effect of it."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.benchmarks.sensitivity import effect_of
from tests.benchmarks.tuned_numbers import find_tuned_numbers, move_on_import, moved

LIMITS = '''
"""A module."""
import math
from dataclasses import dataclass

LIMIT_G = 0.5
"""Largest reading. Basis: a data sheet."""
SPAN = (2, 0.5)
COUNT, SHARE = 3, 0.1
N_AXES = 3
"""Definition: x, y and z."""
ANGLE_RAD = math.radians(30)
NAME = "x"
DOUBLE_G = 2 * LIMIT_G
"""Derived. Definition: twice the limit."""


@dataclass(frozen=True)
class WatchSettings:
    """Settings."""

    hold_s: float = 2.0
    """How long. Basis: a guess."""


@dataclass(frozen=True)
class Result:
    """No settings."""

    value: float = 1.0
'''
USER = """
from sample_limits.limits import LIMIT_G

def check(value, limit=LIMIT_G):
    return value < limit
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A package with numbers and a user of one of them."""
    folder = tmp_path / "sample_limits"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "limits.py").write_text(LIMITS)
    (folder / "user.py").write_text(USER)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    yield "sample_limits"
    for name in [name for name in sys.modules if name.startswith("sample_limits")]:
        del sys.modules[name]


def test_numbers_in_capitals_tuples_and_settings_are_found(package: str) -> None:
    found = {number.label.removeprefix("sample_limits.limits."): number for number in find_tuned_numbers([package])}

    assert list(found) == ["LIMIT_G", "SPAN[0]", "SPAN[1]", "COUNT", "SHARE", "ANGLE_RAD", "WatchSettings.hold_s"]
    assert (found["LIMIT_G"].value, found["LIMIT_G"].meaning, found["LIMIT_G"].basis) == (
        0.5,
        "Largest reading.",
        "a data sheet.",
    )
    assert found["COUNT"].basis == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("label", "expression", "value"),
    [
        ("LIMIT_G", "LIMIT_G", 0.65),
        ("LIMIT_G", "DOUBLE_G", 1.3),
        ("SPAN[1]", "SPAN", (2, 0.65)),
        ("SHARE", "COUNT", 3),
        ("SHARE", "SHARE", 0.13),
        ("COUNT", "COUNT", 4),
        ("WatchSettings.hold_s", "WatchSettings().hold_s", 2.6),
    ],
)
def test_a_number_is_moved_where_it_is_assigned(package: str, label: str, expression: str, value: Any) -> None:
    number = next(each for each in find_tuned_numbers([package]) if each.label.endswith(f".{label}"))

    move_on_import(number, 1.3, top=package)

    limits = importlib.import_module(f"{package}.limits")
    assert eval(expression, vars(limits)) == pytest.approx(value)


def test_a_moved_number_reaches_other_modules_and_defaults(package: str) -> None:
    number = next(each for each in find_tuned_numbers([package]) if each.name == "LIMIT_G")
    assert importlib.import_module(f"{package}.user").check(0.4)

    move_on_import(number, 0.7, top=package)

    assert not importlib.import_module(f"{package}.user").check(0.4)


def test_a_whole_number_moves_by_one_at_least() -> None:
    assert (moved(1, 1.3), moved(1, 0.7), moved(10, 1.3)) == (2, 0, 13)


BASE = {"cpu_s": 1.0, "a": {"states": {"yes": 2}, "errors_deg": [0.1], "widths_deg": [1.0]}}


@pytest.mark.parametrize(
    ("change", "effect"),
    [
        ({}, "none"),
        ({"errors_deg": [0.11]}, "slight"),
        ({"errors_deg": [0.5]}, "angle by 40 % of its interval (a)"),
        ({"widths_deg": [1.5]}, "interval +50 % (a)"),
        ({"states": {"yes": 1, "no": 1}}, "1 of 2 answers in 1 cases"),
    ],
)
def test_effects_are_told_by_answers_intervals_and_angles(change: dict[str, Any], effect: str) -> None:
    assert effect_of(BASE, {"cpu_s": 1.0, "a": BASE["a"] | change}) == effect  # type: ignore[operator]


def test_a_number_that_breaks_the_code_or_slows_it_down_is_reported() -> None:
    assert effect_of(BASE, {"error": "ValueError"}) == "fails (ValueError)"
    assert effect_of(BASE, BASE | {"cpu_s": 3.0}) == "time x 3.0"
