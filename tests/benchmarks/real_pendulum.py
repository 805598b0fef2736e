"""The twin on a real pendulum: all sets of dampings, judged on held-out data, and what none of them explains.

`python -m tests.benchmarks.real_pendulum FOLDER` also writes log.csv, held_out.csv and rig.toml, for `plumbline reconcile`.
"""

import itertools
import sys
from pathlib import Path

import numpy as np

from tests.benchmarks.real_arm import (
    STRETCH,
    Swing,
    believed_length_m,
    fit_arm,
    passages,
    read_swings,
    rig_of,
    rig_toml,
)

DAMPINGS = ("viscous_damping", "quadratic_drag", "coulomb_friction")
WINDOWS_S = (3.0, 9.2, 18.4)
"""Of held-out data, each with a start of its own; the last is all of it in one piece."""
PERIODS = 10


def main(folder: Path | None = None) -> None:
    """Print the tables; write the recordings where a folder is given."""
    log, held_out = read_swings()
    if folder is not None:
        write(folder, log, held_out)
    print_dampings(log, held_out)
    print_periods(log, held_out)


def write(folder: Path, log: Swing, held_out: Swing) -> None:
    """The files that `plumbline reconcile` wants."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "log.csv").write_text(log.csv(), encoding="utf-8")
    (folder / "held_out.csv").write_text(held_out.csv(), encoding="utf-8")
    (folder / "rig.toml").write_text(rig_toml(log), encoding="utf-8")


def print_dampings(log: Swing, held_out: Swing) -> None:
    """Every single effect, every pair, all three."""
    print("rms error of the angle, mrad: log, held-out in windows of", *WINDOWS_S, "s")
    rig = rig_of(log)
    for count in (1, 2, 3):
        for names in itertools.combinations(DAMPINGS, count):
            fitted = fit_arm(rig, log, names)
            errors = [fitted.log_mrad, *(fitted.held_out_mrad(held_out, window_s) for window_s in WINDOWS_S)]
            values = zip(fitted.simulator.effect_parameters, fitted.effects, strict=True)
            said = ", ".join(f"{slot.label} {value:.3g}" for slot, value in values)
            print(f"{' + '.join(names):56}" + "".join(f"{error:8.2f}" for error in errors) + f"   {said}")


def periods(log: Swing, held_out: Swing) -> list[tuple[float, float, float]]:
    """Over the whole recording by tens of periods: time s, amplitude deg, effective length of the arm in mm."""
    time_s = np.concatenate([log.time_s, held_out.time_s])
    angle_rad = np.concatenate([log.angle_rad, held_out.angle_rad])
    at = passages(angle_rad)
    found = []
    for last in range(2 * PERIODS, len(at), 2 * PERIODS):
        stretch = slice(int(at[last - 2 * PERIODS]) - 1, int(at[last]) + 1)
        part = Swing(time_s[stretch], angle_rad[stretch])
        amplitude_deg = float(np.degrees(np.abs(part.angle_rad).max()))
        found.append((float(part.time_s.mean()), amplitude_deg, 1e3 * believed_length_m(part) / STRETCH**2))
    return found


def print_periods(log: Swing, held_out: Swing) -> None:
    """What remains: the period, corrected for amplitude, is not the same all the time."""
    print("\ntime s, largest amplitude deg, g (T0/2 pi)^2 mm")
    for time_s, amplitude_deg, length_mm in periods(log, held_out):
        print(f"{time_s:6.1f} {amplitude_deg:6.1f} {length_mm:9.3f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
