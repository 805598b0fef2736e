"""Recordings of working cranes with the true angle, made anew or read from folders."""

import csv
import json
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.motion.initial_state import Constants
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing
from tests.working_crane.__main__ import make
from tests.working_crane.kinds import case_seeds

Mask = NDArray[np.bool_]

GRAVITY_M_S2 = 9.80665
LENGTH_U_REL, POSITION_U_M = 0.1, 0.05
OFFSET_U_G, MOUNT_U_RAD = 3e-4, 1e-3
MANOEUVRES = ("free", "drive", "hoist", "drive and hoist", "gust")


@dataclass(frozen=True, slots=True)
class WorkRecording:
    """What the sensor read, what is believed of the crane, and the truth at every sample, lost ones included."""

    name: str
    rho: float
    noise_g: float
    believed_length_m: float
    above_load_m: float
    time_s: Array
    force_g: Array
    truth: dict[str, Array]
    rate_rad_s: Array | None = None
    """True angular rate of the housing in its own frame, shape (n, 3); None: not in the files."""

    @property
    def rig(self) -> MountedHousing:
        """What the filter is told."""
        return MountedHousing(
            length_m=self.believed_length_m,
            above_load_m=self.above_load_m,
            length_u_rel=LENGTH_U_REL,
            position_u_m=POSITION_U_M,
            gravity_m_s2=GRAVITY_M_S2,
            zero_g_offset_u_g=(OFFSET_U_G, OFFSET_U_G, OFFSET_U_G),
        )

    @property
    def constants(self) -> Constants:
        """The same, as the filter's priors."""
        return Constants(
            self.believed_length_m,
            LENGTH_U_REL,
            self.above_load_m,
            POSITION_U_M,
            (OFFSET_U_G, OFFSET_U_G, OFFSET_U_G),
            MOUNT_U_RAD,
        )

    @property
    def period_s(self) -> float:
        """Of a small swing at the first sample."""
        return float(2 * np.pi * np.sqrt(self.truth["length_m"][0] / GRAVITY_M_S2))

    def true(self, name: str, time_s: Array) -> Array:
        """Return a column of the truth at times between the first and the last sample."""
        found: Array = np.interp(time_s, self.truth["time_s"], self.truth[name])
        return found

    def manoeuvre(self, time_s: Array) -> NDArray[np.intp]:
        """Return the place in `MANOEUVRES`; a gust in a drive or a hoist counts as those."""
        driven, hoisting, gust = (self.true(name, time_s) > 0.5 for name in ("driven", "hoisting", "gust"))
        return np.where(driven & hoisting, 3, np.where(driven, 1, np.where(hoisting, 2, np.where(gust, 4, 0))))


def generate(kind: str, seed: int, count: int) -> Iterator[WorkRecording]:
    """Yield recordings that are made by `tests.working_crane`."""
    for index, case_seed in enumerate(case_seeds(seed, count)):
        case, made = make(kind, case_seed)
        yield WorkRecording(
            f"{kind} {index}",
            case.rho,
            case.sensor.noise_g,
            case.believed_length_m,
            case.crane.above_load_m,
            made.time_s,
            made.reading_g,
            made.truth,
            made.rate_rad_s,
        )


def read(folder: Path) -> WorkRecording:
    """Return a recording in the files that `tests.working_crane` writes."""
    case = json.loads((folder / "case.json").read_text())
    believed = tomllib.loads((folder / "gateway.toml").read_text())
    log = np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1)
    with (folder / "truth.csv").open() as file:
        names = next(csv.reader(file))
    truth = np.loadtxt(folder / "truth.csv", delimiter=",", skiprows=1)
    return WorkRecording(
        folder.name,
        case["rho"],
        case["noise_g"],
        believed["rope"]["length_m"],
        believed["housing"]["above_load_m"],
        log[:, 0],
        log[:, 1:4],
        dict(zip(names, truth.T, strict=True)),
    )
