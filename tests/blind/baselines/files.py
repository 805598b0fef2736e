"""What all of them read, write and take as arguments."""

import argparse
import csv
import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.twin.model import TwinRig
from tests.blind.mechanics import Array

COLUMNS = ("time_s", "ax_g", "ay_g", "az_g", "temperature_c")


@dataclass(frozen=True, slots=True)
class Measured:
    """A recording, n samples, and how noisy it is believed to be."""

    time_s: Array
    force_g: Array
    temperature_c: Array | None
    noise_g: float | Array
    """1-sigma of each reading; one number, or one per axis."""
    used: NDArray[np.bool_]
    """Samples that count, shape (n,)."""
    began_s: float = 0.0
    """Time of the first sample in the log, where this is the end of the log."""

    @property
    def n_values(self) -> int:
        """Number of readings that count: three for each sample used."""
        return 3 * int(self.used.sum())

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])

    def first(self, count: int) -> "Measured":
        """The first samples alone."""
        temperature_c = None if self.temperature_c is None else self.temperature_c[:count]
        return replace(
            self,
            time_s=self.time_s[:count],
            force_g=self.force_g[:count],
            temperature_c=temperature_c,
            used=self.used[:count],
        )

    def misfit(self, simulated_g: Array) -> Array:
        """Residual in sigma, shape (n, 3); zero where a sample does not count."""
        residual: Array = (self.force_g - simulated_g) / self.noise_g * self.used[:, None]
        return residual

    def reduced_chi2(self, simulated_g: Array) -> float:
        """Chi-square per reading that counts; 1 is noise alone."""
        return float((self.misfit(simulated_g) ** 2).sum()) / self.n_values


@dataclass(frozen=True, slots=True)
class Found:
    """What a method answers."""

    names: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, Any]]
    log_chi2: tuple[float, float]
    """Reduced chi-square on the log, with nothing added and with what was found."""
    base_prediction_g: Array
    """Of the held-out recording with nothing added, shape (n, 3)."""
    prediction_g: Array
    """Of the held-out recording with what was found, shape (n, 3)."""


Method = Callable[[TwinRig, Measured, Measured], Found]


def answer(method: Method, arguments: Sequence[str] | None = None) -> int:
    """Run a method on the files of a case and write what it finds as `plumbline reconcile` would."""
    parser = argparse.ArgumentParser()
    parser.add_argument("verb", choices=["reconcile"])
    parser.add_argument("log", type=Path)
    for name in ("--rig", "--held-out", "--json", "--prediction"):
        parser.add_argument(name, type=Path, required=True)
    chosen = parser.parse_args(arguments)
    rig, noise_g = _read_rig(chosen.rig)
    log, held_out = read_measured(chosen.log, noise_g), read_measured(chosen.held_out, noise_g)
    found = method(rig, log, held_out)
    chosen.json.write_text(json.dumps(_report(found, held_out)))
    table = np.column_stack([held_out.time_s, found.prediction_g])
    np.savetxt(chosen.prediction, table, fmt="%.7f", delimiter=",", header=",".join(COLUMNS[:4]), comments="")
    return 0


def read_measured(path: Path, noise_g: float) -> Measured:
    """Of a CSV recording with a temperature; the first sample, where an engine may not be in motion yet, does not count."""
    with path.open(newline="") as file:
        rows = np.array([[float(row[name]) for name in COLUMNS] for row in csv.DictReader(file)])
    slow = np.polynomial.Polynomial.fit(rows[:, 0], rows[:, 4], 6)
    return Measured(rows[:, 0], rows[:, 1:4], slow(rows[:, 0]), noise_g, np.arange(len(rows)) > 0)


def _read_rig(path: Path) -> tuple[TwinRig, float]:
    rig = tomllib.loads(path.read_text())
    return TwinRig(rig["rope"]["length_m"], rig["housing"]["position_m"], rig["site"]["gravity_m_s2"]), rig["sensor"][
        "noise_g"
    ]


def _report(found: Found, held_out: Measured) -> dict[str, Any]:
    effects = [{"name": name, "parameters": dict(found.parameters.get(name, {}))} for name in found.names]
    return {
        "verdict": "named" if found.names else "none_missing",
        "effects": effects,
        "candidates": [],
        "gap": {
            "before": {"log": found.log_chi2[0], "held_out": held_out.reduced_chi2(found.base_prediction_g)},
            "after": {"log": found.log_chi2[1], "held_out": held_out.reduced_chi2(found.prediction_g)},
        },
    }
