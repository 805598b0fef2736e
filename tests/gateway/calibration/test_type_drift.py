"""How long a calibration holds is learned from all sensors of a type, with an interval that holds the truth."""

from datetime import UTC, datetime

import numpy as np
import pytest

from gateway.calibration.drift.fleet_drift import fleet_drift, learn_days, learn_type_drift
from gateway.calibration.drift.forecast import HORIZON_DAYS
from gateway.numerics.stats import NORMAL_975
from tests.gateway.calibration.test_drift_table import sensor

LIMIT_G = float(np.sin(np.radians(0.5)))
U_G = 0.0005
FLEETS = 200


@pytest.mark.parametrize("sensors", [5, 30])
@pytest.mark.parametrize(("walk_g", "rate_g"), [(0.0003, 0.0), (0.0, 1e-5), (0.0002, 5e-6)])
def test_the_interval_holds_the_true_days_in_nineteen_of_twenty_fleets(
    walk_g: float, rate_g: float, sensors: int
) -> None:
    rng = np.random.default_rng(1)
    true_days = np.roots([rate_g**2, walk_g**2, -((LIMIT_G / NORMAL_975) ** 2)]).max() if rate_g else 0.0
    true_days = min(true_days or (LIMIT_G / NORMAL_975 / walk_g) ** 2, HORIZON_DAYS)
    held = too_late = 0
    for _ in range(FLEETS):
        span_days = np.repeat(rng.uniform(100, 700, sensors), 3)
        variance_g2 = np.full(3 * sensors, 2 * U_G**2)
        total_g = np.sqrt(walk_g**2 * span_days + rate_g**2 * span_days**2 + variance_g2)
        found = learn_days(span_days, rng.normal(0, total_g), variance_g2, sensors, LIMIT_G)
        held += found.low_days <= true_days <= found.high_days
        too_late += found.low_days > true_days

    assert held >= 0.95 * FLEETS
    assert too_late <= 0.05 * FLEETS


def test_a_type_is_learned_from_three_sensors_that_were_calibrated_twice() -> None:
    now = datetime(2026, 11, 22, tzinfo=UTC)
    records = [sensor(f"part-{number}", [0, 200], 0.02 * number) for number in (1, -1, 2)]
    sensors, _ = fleet_drift([record for own in records for record in own], now, limit_deg=0.5)
    assert learn_type_drift(sensors[:2], 0.5) is None
    found = learn_type_drift(sensors, 0.5)
    assert found is not None
    assert found.sensors == 3
    assert found.low_days < found.days <= found.high_days


def test_sensors_that_do_not_drift_need_no_calibration_up_to_the_horizon() -> None:
    span_days, variance_g2 = np.full(90, 3000.0), np.full(90, 1e-10)
    found = learn_days(span_days, np.zeros(90), variance_g2, 30, LIMIT_G)
    assert (found.low_days, found.high_days) == (HORIZON_DAYS, HORIZON_DAYS)
