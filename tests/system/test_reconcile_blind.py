"""`plumbline reconcile` as a process on recordings of the second simulator; `script/campaign` asks hundreds."""

import sys
from pathlib import Path

import pytest

from tests.blind.asking import ask
from tests.blind.cases import generate
from tests.blind.plan import Plan
from tests.blind.score import RIGHT, RIGHT_GROUP
from tests.blind.write import write_case

pytestmark = pytest.mark.slow

LENGTHS_S = {"log": 30.0, "held_out": 20.0}
PATIENCE_S = 600.0
CASES = [
    Plan(index=0, seed=101, kind="null", coloured=True, jittered=True),
    Plan(index=1, seed=103, kind="single", hidden=("steady_wind",)),
    Plan(index=2, seed=104, kind="pair", hidden=("viscous_damping", "vibration")),
    Plan(index=3, seed=105, kind="outside", hidden=("pivot_vibration",)),
]


@pytest.mark.parametrize("plan", CASES, ids=lambda plan: "+".join(plan.hidden) or "null")
def test_hidden_effect_is_found(plan: Plan, tmp_path: Path) -> None:
    write_case(generate(plan, LENGTHS_S), tmp_path)
    row = ask(tmp_path, [sys.executable, "-m", "gateway"], PATIENCE_S)
    assert row["score"] in (RIGHT, RIGHT_GROUP), row
    assert row["closed_percent"] is None or row["closed_percent"] >= 85, row
