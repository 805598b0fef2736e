"""What `remote status` says of the drift: never good news where nothing was seen."""

from typing import Any

import numpy as np
import pytest

from gateway.bus.client import GatewayClient, RpcReply
from gateway.calibration.record import CalibrationError, content_hash
from gateway.cli.remote.remote_status import (
    NO_HEALTH,
    NO_RECORD,
    NO_REST,
    NOT_VALID,
    describe_forecast,
    describe_rest_drift,
)

WATCHED = {
    "calibration_id": "r1",
    "state": "watching",
    "norm_error_mg": -1.25,
    "limit_mg": 5.0,
    "trend": {
        "days": 20,
        "rate_mg_per_day": 0.1,
        "rate95_mg_per_day": [0.0, 0.2],
        "temperature_fitted": False,
        "limit_in_days": 42.4,
    },
    "shows": "one sum",
    "reasons": [],
}


@pytest.mark.parametrize(
    ("health", "said"),
    [
        ({"drift": {"norm_error_mg": "\x1b[2J"}}, NOT_VALID),
        ({"drift": None}, NO_RECORD),
        (
            {"drift": WATCHED | {"state": "no_rest", "norm_error_mg": None, "limit_mg": None, "trend": None}},
            NO_REST,
        ),
        ({"drift": WATCHED}, "watching: norm -1.2 mg of 5.0 mg allowed; limit in 42 days; shows one sum"),
        (
            {"drift": WATCHED | {"state": "alarm", "trend": None, "reasons": ["calibrate"]}},
            "alarm: norm -1.2 mg of 5.0 mg allowed; calibrate; shows one sum",
        ),
    ],
)
def test_the_drift_at_rest_is_one_line(health: dict[str, Any], said: str) -> None:
    assert describe_rest_drift(health | {"calibration_id": "r1"}, {"calibration_id": "r1"}) == said
    assert "not monitored" in NO_RECORD
    assert "not known yet" in NO_REST


@pytest.mark.parametrize(
    ("health", "calibration"),
    [
        (None, None),
        (None, {"calibration_id": "r2"}),
        ({"calibration_id": "r1", "drift": WATCHED}, {"calibration_id": "r2"}),
        ({"calibration_id": None, "drift": None}, {"calibration_id": "r2"}),
    ],
)
def test_the_health_of_another_record_is_ignored(
    health: dict[str, Any] | None, calibration: dict[str, str] | None
) -> None:
    assert describe_rest_drift(health, calibration) == NO_HEALTH


class Store(GatewayClient):
    """A gateway whose device was calibrated on these days of a year, its x offset growing."""

    key = "plumbline/v1/a/b/c"

    def __init__(self, *days: int, history: tuple[dict[str, str | None], ...] = ()) -> None:
        self.history = list(history)
        made = [(f"r{day}", np.datetime64("2026-01-01") + day, 0.0002 * day) for day in days]
        self.records = {name: _record(name, str(date), offset) for name, date, offset in made}

    def ask(self, verb: str, request: dict[str, Any], patience_s: float) -> RpcReply:
        if request.get("what") == "record":
            return RpcReply(True, {"record": self.records[request["record"]]})
        return RpcReply(
            True,
            {
                "device_id": "part-7",
                "in_force": None,
                "review": None,
                "history": self.history,
                "records": [*({"id": name} for name in self.records), {"id": "damaged", "error": "torn"}],
            },
        )


def _record(name: str, date: str, offset: float) -> dict[str, Any]:
    content = {
        "format": 1,
        "id": name,
        "device_id": "part-7",
        "method": "six-position",
        "created_utc": f"{date}T00:00:00Z",
        "software": "test",
        "by": "bench",
        "parent": None,
        "unit": "g",
        "offset": [offset, 0.0, 0.0],
        "correction_matrix": np.eye(3).tolist(),
        "covariance": (1e-8 * np.eye(12)).tolist(),
        "prediction_interval_g": 0.003,
        "temperature_c": {"mean": 20.0, "min": 20.0, "max": 20.0},
    }
    return content | {"sha256": content_hash(content)}


def test_a_record_that_was_withdrawn_makes_no_forecast() -> None:
    forward: tuple[dict[str, str | None], ...] = ({"from": None, "to": "r0"}, {"from": "r0", "to": "r90"})
    assert "from 2 records over 90 days" in describe_forecast(Store(0, 30, 90, history=forward))
    with pytest.raises(CalibrationError):
        describe_forecast(Store(0, 90, history=(*forward, {"from": "r90", "to": "r0"})))


def test_records_make_a_forecast() -> None:
    said = describe_forecast(Store(0, 30, 60, 90))
    assert said.startswith("Recalibrate within ")
    assert "error of axis x may reach 0.5" in said
    assert "from 4 records over 90 days" in said


def test_one_record_gives_no_forecast() -> None:
    with pytest.raises(CalibrationError, match="two calibrations at least"):
        describe_forecast(Store(0))
