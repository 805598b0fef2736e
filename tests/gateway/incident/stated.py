"""What a gateway states of itself and of its alerts, as messages from which the course of an incident is built."""

from dataclasses import replace
from typing import Any

import numpy as np

from gateway.incident.course_builder import CourseBuilder
from gateway.messages import (
    NO_SESSION,
    ActiveAlert,
    Alert,
    AlertEventKind,
    Calibration,
    Health,
    Level,
)

ORIGIN_NS = 1_767_225_600_000_000_000
HEAD: dict[str, Any] = {"time_ns": ORIGIN_NS, "clock": "synchronised", "sequence": 0}


def calibration(gain: float = 0.5, **session: Any) -> Calibration:
    in_force = {"gain_g_per_unit": (gain * np.eye(3)).tolist(), "bias_g": [0.0, 0.0, 1.0], "unit": "counts"}
    return Calibration(
        **HEAD,
        status="calibrated",
        device_id="part-7",
        record={},
        in_force=in_force,
        text="calibrated",
        session=replace(NO_SESSION, **session),
    )


def health(**changes: Any) -> Health:
    common: dict[str, Any] = {
        "state": "running",
        "device_kind": "adxl355",
        "boot_id": "b00t",
        "software": "0.1.0",
        "uptime_s": 1.0,
        "samples": 10,
        "lost": 0,
        "invalid": 0,
        "faults": {},
        "dropped": {},
    }
    return Health(**HEAD, **(common | changes))


def built(*messages: tuple[float, object]) -> CourseBuilder:
    builder = CourseBuilder(ORIGIN_NS)
    for time_s, message in messages:
        builder.add(ORIGIN_NS + round(time_s * 1e9), message)
    return builder


def active(rule: str, level: Level, incident: str | None) -> ActiveAlert:
    limit_deg = 6.0 if level == "trip" else 4.0
    return ActiveAlert(
        rule=rule,
        level=level,
        since_ns=0,
        limit_deg=limit_deg,
        clear_deg=3.0,
        incident=incident,
        text=f"{rule} {level}",
    )


def alert(event: AlertEventKind, rule: str | None, *standing: ActiveAlert, incident: str | None = None) -> Alert:
    return Alert(
        time_ns=0,
        clock="synchronised",
        sequence=0,
        level="normal",
        event=event,
        rule=rule,
        incident=incident,
        active=list(standing),
        text="",
    )
