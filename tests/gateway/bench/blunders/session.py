"""One session of a person at the bench: a sensor, a folder, and the arguments of the command that the files are for."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.gateway.bench.planted import thermal, workshop
from tests.gateway.bench.planted.thermal import Values
from tests.gateway.bench.planted.workshop import BenchSensor, write_readings, write_table


@dataclass(slots=True)
class Session:
    """Draws of one session; every method writes files and returns arguments."""

    random: np.random.Generator
    folder: Path
    sensor: BenchSensor

    def rests(self, readings: dict[str, Values], method: str, unit: str = "g", *more: str) -> list[str]:
        """Return the command for one file per rest."""
        files = [str(write_readings(self.folder / f"{name}.csv", raw, unit)) for name, raw in readings.items()]
        return ["calibrate", method, *files, "--device-id", "part-7", *more]

    def faces(self) -> dict[str, Values]:
        """Return the readings of the six faces."""
        return workshop.faces(self.random, self.sensor)

    def poses(self, count: int = 14) -> dict[str, Values]:
        """Return the readings of poses all round."""
        return workshop.poses(self.random, self.sensor, count)

    def other(self) -> BenchSensor:
        """Return another part of the same type."""
        return workshop.draw_sensor(self.random)

    def turns(
        self,
        change: Callable[[int, Values, Values], tuple[Values, Values]] | None = None,
        unit: str = "g",
        **rig: float,
    ) -> list[str]:
        """Return the command for turns about y and x; `change` is what the person does to a table of angles and readings."""
        files = []
        for about in (1, 0):
            angle_deg, raw = workshop.turn(self.random, self.sensor, about, **rig)
            if change is not None:
                angle_deg, raw = change(about, angle_deg, raw)
            files.append(str(self.turn_file("xyz"[about], angle_deg, raw, unit)))
        return ["calibrate", "rotation", *files, "--device-id", "part-7"]

    def turn_file(self, name: str, angle_deg: Values, raw: Values, unit: str = "g") -> Path:
        """Write one turn."""
        columns = {"angle_deg": angle_deg} | {f"a{axis}_{unit}": raw[:, place] for place, axis in enumerate("xyz")}
        return write_table(self.folder / f"about_{name}.csv", columns)

    def pairs(
        self, change: Callable[[Values], Values] = lambda pairs: pairs, *, distance_factor: float = 1.0
    ) -> list[str]:
        """Return the command for laser pairs; the distance that the person states is the true one times a factor."""
        distance_mm = self.random.uniform(2500, 6000)
        rows = change(workshop.laser_pairs(self.random, self.random.normal(0, 0.015), distance_mm))
        path = write_table(self.folder / "pairs.csv", {"displacement_mm": rows[:, 0], "raw_angle_deg": rows[:, 1]})
        stated = f"{distance_mm * distance_factor:.2f}"
        return ["calibrate", "single-parameter", str(path), "--distance-mm", stated, "--device-id", "part-7"]

    def ramps(
        self,
        change: Callable[[int, Values, Values], tuple[Values, Values]] | None = None,
        unit: str = "g",
        *,
        temperature: bool = True,
    ) -> list[str]:
        """Return the command for six ramps; `change` gets face, readings and temperatures."""
        truth = thermal.draw_truth(self.random)
        files = []
        recordings = thermal.six_recordings(self.random, truth, "ramp", 120.0, thermal.Disturbances(placement_deg=0.08))
        for face, (time_s, read, measured_c) in enumerate(recordings):
            raw, known_c = (read, measured_c) if change is None else change(face, read, measured_c)
            path = self.folder / f"ramp{face}.csv"
            written_c = known_c if temperature else None
            files.append(str(write_readings(path, raw, unit, time_s=time_s[: len(raw)], temperature_c=written_c)))
        return ["calibrate", "thermal", *files, "--device-id", "part-7"]

    def girder(
        self,
        left: tuple[int, float] = (1, 1.0),
        right: tuple[int, float] = (-1, 1.0),
        *options: str,
        late_s: float = 0.0,
        change: Callable[[str, Values, Values], Values] | None = None,
    ) -> list[str]:
        """Return the command for both ends; `left` and `right` are direction and share of the rotation that is there."""
        rotation = self.random.uniform(2e-3, 8e-3)
        files = []
        for name, (sign, share) in (("left", left), ("right", right)):
            time_s, raw = workshop.girder_end(self.random, sign, rotation * share)
            if change is not None:
                raw = change(name, time_s, raw)
            shifted = time_s + (late_s if name == "right" else 0.0)
            files.append(str(write_readings(self.folder / f"{name}.csv", raw, time_s=shifted)))
        return ["fleet", "deflection", *files, "--half-span-m", "5", *options]
