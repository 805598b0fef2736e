"""The table of values that a plant gets. Registers, nodes, topics and docs/reference/plant_values.md follow from it."""

from dataclasses import dataclass
from typing import Literal

from gateway.bridge.plant_snapshot import LEVEL_CODES, LONGEST_AGE_MS, SOURCE_CODES, STATE_CODES, Code, PlantSnapshot

Reading = float | int | str | None
"""A value as the snapshot has it; None: not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantValue:
    """One row. Names and registers are interfaces: add rows, and change or move none."""

    name: str
    """Of the attribute of a snapshot, the field in MQTT and the node in OPC UA."""
    meaning: str
    register: int
    """Of the scaled integer, from 0."""
    low: float = 0
    high: float = 32_766
    unit: str = ""
    step: float = 1
    """The value of 1 in the register."""
    words: Literal[1, 2] = 1
    """Registers of the integer."""
    float_register: int | None = None
    """Of the same value as a number of 32 bits, IEEE 754, in two registers."""
    codes: dict[str, Code] | None = None
    """The words that a value can have, with their numbers."""

    def read(self, snapshot: PlantSnapshot) -> Reading:
        """Return the value as it is known."""
        value: Reading = getattr(snapshot, self.name)
        return value

    def number(self, snapshot: PlantSnapshot) -> float | int | None:
        """Return the value as a number; None: not known, or out of the range that is promised."""
        value = self.read(snapshot)
        if isinstance(value, str):
            return self.codes[value].number if self.codes is not None and value in self.codes else None
        return value if value is not None and self.low <= value <= self.high else None


def _angle(name: str, register: int, float_register: int, meaning: str) -> PlantValue:
    return PlantValue(
        name=name, meaning=meaning, register=register, float_register=float_register, high=180, unit="deg", step=0.01
    )


PLANT_VALUES: tuple[PlantValue, ...] = (
    PlantValue(name="schema_version", meaning="version of this table; a wrong address shows here", register=0, low=1),
    PlantValue(
        name="state", meaning="1: the values below are known now; else why not", register=1, high=13, codes=STATE_CODES
    ),
    PlantValue(
        name="heartbeat",
        meaning="rises with each valid reading that is taken, modulo 65536; it stands still while nothing is known",
        register=2,
        high=65_535,
    ),
    PlantValue(
        name="age_ms",
        meaning="since the newest reading arrived at the bridge; an older one states the largest",
        register=3,
        high=LONGEST_AGE_MS,
        unit="ms",
    ),
    PlantValue(name="level", meaning="highest level of the alerts", register=4, high=3, codes=LEVEL_CODES),
    PlantValue(
        name="active_alerts",
        meaning="number of warnings and alarms that stand; not known where the level is unknown",
        register=5,
    ),
    _angle("angle_deg", 6, 32, "angle between rope and vertical now"),
    _angle("angle_u95_deg", 7, 34, "half the width of its 95 % interval"),
    _angle("phi_max_deg", 8, 36, "largest angle of the last period"),
    _angle("phi_max_u95_deg", 9, 38, "half the width of its 95 % interval"),
    _angle("peak_deg", 10, 40, "expected next maximum of the angle, on which the alerts rest"),
    _angle("peak_u95_deg", 11, 42, "half the width of its 95 % interval"),
    PlantValue(
        name="time_to_peak_s",
        meaning="time from the newest reading to the expected maximum",
        register=12,
        float_register=44,
        high=327,
        unit="s",
        step=0.01,
    ),
    PlantValue(name="source", meaning="what takes the samples", register=13, high=3, codes=SOURCE_CODES),
    PlantValue(
        name="calibration_age_days",
        meaning="age of the calibration in force",
        register=14,
        float_register=46,
        unit="d",
    ),
    PlantValue(
        name="battery_percent",
        meaning="charge of a wireless sensor's battery, where there is one",
        register=15,
        float_register=48,
        high=100,
        unit="%",
    ),
    PlantValue(name="battery_v", meaning="its voltage", register=16, float_register=50, high=32, unit="V", step=0.001),
    PlantValue(
        name="alert_number",
        meaning="number of the last change of an alert, which continues over restarts of the gateway",
        register=17,
        words=2,
        high=4_294_967_294,
    ),
    PlantValue(
        name="boot",
        meaning="a number that differs from start to start of the gateway",
        register=19,
        words=2,
        high=4_294_967_294,
    ),
)
"""Definition: their places, ranges and steps."""
