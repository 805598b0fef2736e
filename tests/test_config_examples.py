"""The example configurations are accepted, and say what they claim."""

import re
from pathlib import Path

import pytest

from gateway.bridge.settings import load_settings
from gateway.configuration.device_sections import DEVICE_SECTIONS
from gateway.configuration.loading import load
from gateway.configuration.model import AlertsSection, Configuration
from gateway.stages.alerts import DECISION_FACTOR

FOLDER = Path(__file__).parents[1] / "config"
KINDS = {f"{kind}.toml": kind for kind in DEVICE_SECTIONS if kind != "replay"}


def test_there_are_no_others() -> None:
    assert {path.name for path in FOLDER.iterdir()} == {*KINDS, "bridge.toml"}


def test_the_example_of_the_bridges_states_their_defaults() -> None:
    assert load_settings(FOLDER / "bridge.toml") == load_settings(None)


@pytest.mark.parametrize("name", KINDS)
def test_is_accepted_and_commented(name: str) -> None:
    configuration = load(FOLDER / name, {})
    assert configuration.device.kind == KINDS[name]
    assert configuration.housing_position_m is not None
    keys = [line for line in (FOLDER / name).read_text().splitlines() if "=" in line and not line.startswith("#")]
    assert sum("#" in line for line in keys) >= len(keys) / 3


def test_the_simulated_example_is_the_embedded_default() -> None:
    example, embedded = load(FOLDER / "simulated.toml", {}), Configuration()
    assert example.housing_position_m == embedded.housing_position_m
    assert example.model_copy(update={"housing": embedded.housing}) == embedded


@pytest.mark.parametrize("name", KINDS)
def test_what_is_compared_with_the_limits_is_said_as_the_code_has_it(name: str) -> None:
    said = (AlertsSection.__doc__ or "").partition(", ")[2].rstrip(".")
    assert f"the angle plus {DECISION_FACTOR:g} standard uncertainties" in said
    heading = re.findall(r"^\[alerts\] *# (.*)$", (FOLDER / name).read_text(), re.MULTILINE)
    assert heading in ([said], [])
