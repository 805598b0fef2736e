"""The name under which the distribution is installed, and the hints that tell users to install its extras."""

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.extras import LIBRARIES, Extra, what_is_missing

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HINT = re.compile(r"\binstall '([\w./-]+)\[([\w,]+)\]'")


def _hints() -> Iterator[tuple[str, str, str]]:
    """Yield file, place of the package and extra of every hint."""
    for folder in ("gateway", "devices", "docs", "deploy"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in {".py", ".md", ".sh"}:
                for place, extras in HINT.findall(path.read_text()):
                    yield from ((path.name, place, extra) for extra in extras.split(","))


@pytest.mark.slow
def test_every_installation_hint_names_a_clone_and_one_of_its_extras() -> None:
    """No package index has the distribution."""
    hints = list(_hints())
    assert {extra for _, _, extra in hints} == {"archive", "cluster", "laser", "opcua", "relay", "security", "twin"}
    for file, place, extra in hints:
        assert (file, place) in {(file, "."), (file, "./plumbline")}
        assert extra in PROJECT["optional-dependencies"]


@pytest.mark.parametrize("extra", LIBRARIES)
def test_what_is_missing_is_said_with_the_extra_that_brings_it(extra: Extra) -> None:
    said = what_is_missing(extra, ["no_such_library"])
    remedy = f"install the extra {extra}, in a clone by {sys.executable} -m pip install '.[{extra}]'"
    assert said == f"no_such_library not installed; {remedy}"


def test_every_extra_whose_libraries_are_looked_for_is_one_of_the_distribution() -> None:
    assert set(LIBRARIES) <= set(PROJECT["optional-dependencies"])


def test_the_command_is_named_plumbline() -> None:
    assert PROJECT["scripts"] == {"plumbline": "gateway.cli.main:run_program"}
