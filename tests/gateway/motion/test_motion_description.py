"""What acts on crane and load, in words."""

from typing import Any

import pytest

from gateway.motion.description import engineer_reasons, is_cause_distinct
from gateway.motion.estimate import MotionEstimate


def drive(size_m_s2: float) -> dict[str, Any]:
    return {"state": "driven", "pivot_acceleration_m_s2": (size_m_s2, 0.0), "pivot_acceleration_u_m_s2": 0.1}


def push(size: float) -> dict[str, Any]:
    return {"state": "wind", "push": size, "push_u": 0.01}


@pytest.mark.parametrize(("faint", "distinct"), [(drive(0.05), drive(0.4)), (push(0.01), push(0.04))])
def test_a_cause_is_stated_where_its_size_differs_from_zero(faint: dict[str, Any], distinct: dict[str, Any]) -> None:
    weak, strong = MotionEstimate(time_s=0.0, **faint), MotionEstimate(time_s=0.0, **distinct)

    assert not is_cause_distinct(weak)
    assert is_cause_distinct(strong)
    assert engineer_reasons(weak)[0].startswith("perhaps ")
    assert not engineer_reasons(strong)[0].startswith("perhaps ")


def test_a_free_swing_has_no_cause_to_doubt() -> None:
    assert is_cause_distinct(MotionEstimate(time_s=0.0, state="free"))
