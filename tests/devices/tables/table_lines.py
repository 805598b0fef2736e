"""Lines of a CSV recording whose rows are told by their x axis, and what came of them."""

from pathlib import Path
from typing import Protocol

import numpy as np

from devices.recording import Recording
from devices.tables.layout import TableLayout

REAL = Path(__file__).parents[2] / "data" / "real"
SIX_POSITION = TableLayout(axes=("acc_x", "acc_y", "acc_z"), unit="counts", rate_hz=204.8)
PHONE = TableLayout(time=1, axes=(2, 3, 4), delimiter="\t")
HEADER = "time_s,ax_g,ay_g,az_g"


class WriteTable(Protocol):
    """Write lines as a recording, and return its path."""

    def __call__(self, *lines: str, end: str = "\n", name: str = "recording.csv") -> Path: ...


def row(number: int, time_s: float | None = None) -> str:
    return f"{0.02 * number if time_s is None else time_s:.6f},0.{number:03d}0,-0.0100,0.9990"


def rows(count: int) -> list[str]:
    return [row(number) for number in range(count)]


def kept_rows(recording: Recording) -> list[int]:
    """Numbers of the rows that came through, read back from their x axis."""
    numbers: list[int] = np.rint(recording.raw[:, 0] * 1000).astype(int).tolist()
    return numbers


def counts(recording: Recording) -> dict[str, int]:
    names = ("lost", "repeated", "backward", "invalid", "blank", "truncated")
    return {name: getattr(recording, name) for name in names if getattr(recording, name)}
