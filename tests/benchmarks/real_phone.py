"""What a phone's fall and its rest tell together: zero-g offset, scale, and a force that grows with the speed.

`python -m tests.benchmarks.real_phone` prints the table of docs/evidence/twin_real.md. In a free fall nothing but the zero-g
offset is read, and what the air does; at rest it is the offset and 1 g.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2

Array = NDArray[np.float64]
REAL = Path(__file__).parents[1] / "data" / "real"
FALL_G, EDGE_S = 0.2, 0.02
"""The fall is where the norm stays below this, less its edges."""
BEGINNING_S = 0.3
"""Of the fall, before the air matters."""
POWERS = (0, 1, 2, 4, 6)


def read(name: str) -> Array:
    """Time in s and readings in g, shape (n, 4)."""
    return np.loadtxt(REAL / name)[:, :4] / [1, *(STANDARD_GRAVITY_M_S2,) * 3]


def fall() -> tuple[Array, Array]:
    """Seconds since the release (n,) and readings (n, 3) in g."""
    rows = read("phone_falling.txt")
    falling = np.flatnonzero(np.linalg.norm(rows[:, 1:], axis=1) < FALL_G)
    last = falling[np.flatnonzero(np.diff(falling) > 1)[0]] if (np.diff(falling) > 1).any() else falling[-1]
    since_s = rows[:, 0] - rows[falling[0], 0]
    inside = (since_s > EDGE_S) & (since_s < rows[last, 0] - rows[falling[0], 0] - EDGE_S)
    return since_s[inside], rows[inside, 1:]


def left_g(since_s: Array, force_g: Array, power: int) -> tuple[float, Array]:
    """What offset and a force in proportion to speed^power leave, rms over all axes, and that force at 5 m/s (3,), in g."""
    design = np.ones((len(since_s), 1))
    if power:
        design = np.column_stack([design, (STANDARD_GRAVITY_M_S2 * since_s / 5) ** power])
    found = np.linalg.lstsq(design, force_g, rcond=None)[0]
    left = force_g - design @ found
    return float(np.sqrt((left**2).sum() / (left.size - found.size))), found[-1] if power else np.zeros(3)


def main() -> None:
    """Print it."""
    since_s, force_g = fall()
    beginning = force_g[since_s < BEGINNING_S]
    offset_g, noise_g = beginning.mean(axis=0), beginning.std(axis=0, ddof=1)
    rest_g = read("phone_at_rest.txt")[:, 1:].mean(axis=0)
    print(
        f"offset in the first {BEGINNING_S} s of the fall, mg: {np.round(offset_g * 1e3, 1)}, noise {np.round(noise_g * 1e3, 1)}"
    )
    print(
        f"norm at rest, g: {np.linalg.norm(rest_g):.4f} as read, {np.linalg.norm(rest_g - offset_g):.4f} without that offset"
    )
    for power in POWERS:
        left, force = left_g(since_s, force_g, power)
        print(f"speed^{power}: leaves {left * 1e3:.2f} mg; force at 5 m/s, mg: {np.round(force * 1e3, 1)}")


if __name__ == "__main__":
    main()
