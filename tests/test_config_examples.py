"""The example configurations are accepted, and say what they claim."""

from pathlib import Path

import pytest

from gateway.configuration.loading import load
from gateway.configuration.model import Configuration

FOLDER = Path(__file__).parents[1] / "config"
CHIPS = ("ads1115", "adxl345", "adxl355", "adxl357", "lis2dw12", "lis3dh", "mpu6050", "mpu9250")
KINDS = {f"{kind}.toml": kind for kind in ("aspp", "iio", "node", "simulated", "single_axis", "witmotion", *CHIPS)}


def test_there_are_no_others() -> None:
    assert {path.name for path in FOLDER.iterdir()} == set(KINDS)


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
