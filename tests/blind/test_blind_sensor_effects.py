"""Effects of the sensor and its housing that the second simulator hides and `plumbline reconcile` finds."""

import sys
from pathlib import Path

import pytest

from tests.blind.asking import ask
from tests.blind.cases import generate
from tests.blind.plan import Plan
from tests.blind.score import RIGHT
from tests.blind.write import write_case

COMMAND = (sys.executable, "-m", "gateway")
LENGTHS_S = {"log": 40.0, "held_out": 24.0}
CASES = (
    ("lever_arm", 101),
    ("housing_rocking", 308),
    ("housing_torsion", 203),
    ("sample_hold", 801),
    ("mount_misalignment", 705),
)
"""The last one is a housing that hangs 25 degrees askew."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), CASES)
def test_hidden_effect_of_the_sensor_is_named(name: str, seed: int, tmp_path: Path) -> None:
    write_case(generate(Plan(index=0, seed=seed, kind="single", hidden=(name,)), LENGTHS_S), tmp_path)
    row = ask(tmp_path, COMMAND, timeout_s=900.0)

    assert (row["score"], row["named"]) == (RIGHT, [name]), row
