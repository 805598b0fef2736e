"""What `measure` says of the conditions of a whole recording."""

from pathlib import Path

import numpy as np

from gateway.measurement.measure import summarise_conditions
from gateway.measurement.source import read_source


def test_the_most_frequent_reason_is_said_not_that_of_the_first_window(tmp_path: Path) -> None:
    """The first windows have less than a second of data; the others are unknown because no rig is known."""
    time_s = np.arange(3000) / 100
    angle = np.radians(8) * np.cos(1.5 * time_s)
    force_g = np.column_stack([-0.25 * np.sin(angle), np.zeros(3000), np.cos(angle)])
    force_g += np.random.default_rng(1).normal(0, 1e-3, force_g.shape)
    path = tmp_path / "log.csv"
    header = "time_s,ax_g,ay_g,az_g"
    np.savetxt(path, np.column_stack([time_s, force_g]), delimiter=",", header=header, comments="")
    summary = summarise_conditions(read_source([path]))
    assert summary.verdict == "unknown"
    assert summary.reasons != ("less than a second of data",)


def test_windows_that_are_too_short_do_not_count_beside_others(tmp_path: Path) -> None:
    """A recording of 2.6 s has five windows, the first of which is too short."""
    path = tmp_path / "log.csv"
    rows = "".join(f"{n / 50:.2f},{0.001 * (n % 3)},{0.001 * (n % 2)},1\n" for n in range(130))
    path.write_text("time_s,ax_g,ay_g,az_g\n" + rows)
    summary = summarise_conditions(read_source([path]))
    assert summary.reasons != ("less than a second of data",)
    assert sum(summary.windows.values()) == 4
