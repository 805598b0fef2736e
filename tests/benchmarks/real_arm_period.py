"""What the arm's period says of its stiffness at each amplitude, and which causes describe its change.

    python -m tests.benchmarks.real_arm_period

The period of every swing is corrected exactly for its amplitude, T = T0 2 K(sin(A/2))/pi. What is left changes with the
amplitude, which in a single decay falls with time: causes that depend on either are compared by least squares, one or two at a
time.
"""

from collections.abc import Collection
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import ellipk, j1

from tests.benchmarks.real_arm import DATA, GRAVITY_M_S2

Array = NDArray[np.float64]
SWINGS_PER_ROW = 9
MIN_U_MM = 0.003
"""Least standard uncertainty of a row, mm: the scatter of nine swings can be smaller by chance."""
PAIRS_SHOWN = 8


def equivalent_lengths() -> tuple[Array, Array, Array]:
    """Return for each swing its middle in s, its amplitude in rad and g (T0/2 pi)^2 in mm, each of shape (swings,)."""
    time_s, angle_rad = np.loadtxt(DATA, delimiter=",", skiprows=1, usecols=(0, 1)).T
    angle = CubicSpline(time_s, angle_rad)
    passages_s, turns_s = angle.roots(extrapolate=False), angle.derivative().roots(extrapolate=False)
    period_s = passages_s[2:] - passages_s[:-2]
    spans = zip(passages_s[:-2], passages_s[2:], strict=True)
    amplitude = np.array([np.abs(angle(turns_s[(turns_s > a) & (turns_s < b)])).mean() for a, b in spans])
    length_mm = 1e3 * GRAVITY_M_S2 * (period_s / period_ratio(amplitude) / (2 * np.pi)) ** 2
    return passages_s[1:-1], amplitude, length_mm


def period_ratio(amplitude_rad: Array) -> Array:
    """Return the period over that of a small swing."""
    ratio: Array = 2 / np.pi * ellipk(np.sin(amplitude_rad / 2) ** 2)
    return ratio


def causes(time_s: Array, a: Array) -> dict[str, Array]:
    """Return the relative change of the length that a unit of each cause makes, by harmonic balance."""
    slope = (np.log(period_ratio(a + 1e-5)) - np.log(period_ratio(a - 1e-5))) / 2e-5
    return {
        "friction that holds before it slides, A^-3/2": -(a**-1.5),
        "torque in proportion to the angle": -a / (2 * j1(a)),
        "encoder off centre, once per turn": -2 * slope * np.sin(a),
        "encoder's scale": -2 * slope * a,
        "torque twice per turn": -j1(2 * a) / (2 * j1(a)),
        "moved mass, A^2": a**2,
        "clock or warming, t": time_s,
        "clock or warming, t^2": time_s**2,
    }


def fit(rows: tuple[Array, Array], shapes: Collection[Array]) -> tuple[float, Array, Array]:
    """Return chi-square, the coefficients and their standard uncertainties."""
    length_mm, u_mm = rows
    design = np.stack([np.ones_like(length_mm), *shapes], axis=1) * length_mm.mean() / u_mm[:, None]
    found = np.linalg.lstsq(design, length_mm / u_mm, rcond=None)[0]
    u = np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    return float(((length_mm / u_mm - design @ found) ** 2).sum()), found[1:], u[1:]


def main() -> None:
    """Print the table of lengths and the causes, best first."""
    swings = equivalent_lengths()
    count = len(swings[0]) // SWINGS_PER_ROW
    rows = [each[: count * SWINGS_PER_ROW].reshape(count, -1) for each in swings]
    time_s, amplitude, length_mm = (each.mean(axis=1) for each in rows)
    u_mm = np.maximum(rows[2].std(axis=1) / np.sqrt(SWINGS_PER_ROW), MIN_U_MM)
    for t, a, mm, u in zip(time_s, amplitude, length_mm, u_mm, strict=True):
        print(f"{t:5.1f} s  {np.degrees(a):5.1f} deg  {mm:.3f} mm +- {u:.3f}")
    shapes = causes(time_s, amplitude)
    print(f"nothing: chi-square {fit((length_mm, u_mm), [])[0]:.0f} of {count} rows")
    tried = [*((name,) for name in shapes), *combinations(shapes, 2)]
    results = [(names, *fit((length_mm, u_mm), [shapes[name] for name in names])) for names in tried]
    for size, shown in ((1, len(shapes)), (2, PAIRS_SHOWN)):
        for names, chi2, values, u in sorted((r for r in results if len(r[0]) == size), key=lambda r: r[1])[:shown]:
            sizes = "; ".join(f"{n}: {v:.3g} +- {s:.1g}" for n, v, s in zip(names, values, u, strict=True))
            print(f"chi-square {chi2:6.0f}  {sizes}")


if __name__ == "__main__":
    main()
