"""Frequencies of the bodies about their rest, from the engine's own accelerations, against closed forms."""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq, fsolve
from scipy.special import j0, j1, y0, y1

from tests.blind.mechanics import Array
from tests.working_crane.real.bodies import pivot, point, site
from tests.working_crane.real.draw import Draw
from tests.working_crane.real.engine import at_rest
from tests.working_crane.real.heavy_rope import chain
from tests.working_crane.real.moves import Moves
from tests.working_crane.real.one_rope import one_rope
from tests.working_crane.real.reeving import HOOK_M, block, falls_of_block
from tests.working_crane.real.rig import G_M_S2, Place, Rig, Rope
from tests.working_crane.real.spreader import LOAD_BELOW_M, LOAD_SIZE_M, four_ropes, spreader_body

pytestmark = pytest.mark.slow

STEP_S = 0.002
STILL = Moves(np.arange(10) * STEP_S / 2, (), 0.1)
SMALL = 1e-5


def frequencies_hz(rig: Rig) -> Array:
    """Return the frequencies of small motions about rest, lowest first, without those of driven joints."""
    model, data, drive = at_rest(rig, STEP_S)
    free = np.setdiff1d(np.arange(model.nv), [model.joint(name).dofadr[0] for name in rig.driven])
    rest = data.qpos.copy()
    stiffness = np.empty((len(free), len(free)))
    mujoco.set_mjcb_control(drive)
    try:
        for column, dof in enumerate(free):
            sides = []
            for sign in (1.0, -1.0):
                data.qpos[:] = rest
                way = np.zeros(model.nv)
                way[dof] = sign * SMALL
                mujoco.mj_integratePos(model, data.qpos, way, 1.0)
                data.qvel[:] = 0.0
                mujoco.mj_forward(model, data)
                sides.append(data.qacc[free].copy())
            stiffness[:, column] = (sides[1] - sides[0]) / (2 * SMALL)
    finally:
        mujoco.set_mjcb_control(None)
    squares = np.linalg.eigvals(stiffness).real
    return np.sort(np.sqrt(np.maximum(squares, 0.0))) / (2 * np.pi)


def plain(bodies: str, ropes: tuple[Rope, ...], end: str = "load", load: str = "load") -> Rig:
    return Rig(bodies, ropes, Place("pivot", end, above_end_m=1.0), STILL, end=end, load=load)


def draws() -> Draw:
    return Draw(np.random.default_rng(1), 0, STILL.time_s, 10.0)


def test_point_load_swings_like_a_pendulum_and_bounces_on_its_rope() -> None:
    parts = one_rope(draws(), 12.0, 1500.0, 3.0, bounce_hz=3.0)
    found_hz = frequencies_hz(plain(parts.bodies, parts.ropes))
    np.testing.assert_allclose(found_hz[:2], np.sqrt(G_M_S2 / 12.0) / (2 * np.pi), rtol=1e-5)
    assert found_hz[2] == pytest.approx(3.0, rel=1e-4)


def test_hook_and_load_swing_like_a_double_pendulum() -> None:
    upper_m, lower_m, share = 14.0, 2.5, 0.1
    parts = one_rope(draws(), upper_m, 3000.0, 3.0, bounce_hz=40.0, slings=(lower_m, share))
    found_hz = frequencies_hz(plain(parts.bodies, parts.ropes, "hook"))
    mass, lengths = 1 + 1 / share, 1 / upper_m + 1 / lower_m
    root = np.sqrt(mass**2 * lengths**2 - 4 * mass / (upper_m * lower_m))
    expected_hz = np.sqrt(G_M_S2 / 2 * (mass * lengths + np.array([-root, root]))) / (2 * np.pi)
    assert found_hz[0] == pytest.approx(expected_hz[0], rel=1e-4)
    assert found_hz[2] == pytest.approx(expected_hz[1], rel=5e-3)


def test_heavy_rope_has_the_frequencies_of_a_hanging_chain_with_a_load() -> None:
    length_m, rope_kg, load_kg = 25.0, 60.0, 400.0
    found_hz = frequencies_hz(plain(pivot(site("pivot") + chain(length_m, rope_kg, load_kg)), ()))
    low_m = load_kg * length_m / rope_kg

    def condition(rate: float) -> float:
        """At x above the point where the tension would vanish: y = A J0 + B Y0 of 2 w sqrt(x/g); y = 0 at the pivot."""

        def shapes(x_m: float) -> tuple[Array, Array]:
            argument, slope = 2 * rate * np.sqrt(x_m / G_M_S2), rate / np.sqrt(x_m * G_M_S2)
            return np.array([j0(argument), y0(argument)]), -slope * np.array([j1(argument), y1(argument)])

        top, _ = shapes(low_m + length_m)
        value, slope = shapes(low_m)
        lower = rate**2 * value + G_M_S2 * slope
        return float(top[0] * lower[1] - top[1] * lower[0])

    rates = np.linspace(0.1, 12.0, 2000)
    values = [condition(rate) for rate in rates]
    edges = [i for i in range(len(rates) - 1) if values[i] * values[i + 1] < 0]
    expected_hz = [brentq(condition, rates[i], rates[i + 1]) / (2 * np.pi) for i in edges]
    assert found_hz[0] == pytest.approx(expected_hz[0], rel=1e-4)
    assert found_hz[2] == pytest.approx(expected_hz[1], rel=5e-3)
    assert found_hz[4] == pytest.approx(expected_hz[2], rel=1e-2)


def linkage(top_m: float, block_m: float, length_m: float, below_m: float) -> tuple[float, float]:
    """Return, of a body between two inextensible converging parts, x' and z'' of the point below its middle, per turn."""
    part_m = np.hypot(length_m, (top_m - block_m) / 2)

    def place(turn_rad: float) -> tuple[float, float]:
        cosine, sine = np.cos(turn_rad), np.sin(turn_rad)

        def stretched(middle: Array) -> list[float]:
            ends = [(middle[0] + s * block_m / 2 * cosine, middle[1] + s * block_m / 2 * sine, s) for s in (-1, 1)]
            return [float(np.hypot(x - s * top_m / 2, z) - part_m) for x, z, s in ends]

        x, z = fsolve(stretched, [0.0, -length_m], xtol=1e-14)
        return x + below_m * sine, z - below_m * cosine

    small = 1e-3
    (x_m, z_m), (_, rest_m) = place(small), place(0.0)
    return x_m / small, 2 * (z_m - rest_m) / small**2


def test_spreader_on_four_converging_ropes_sways_at_the_frequencies_of_the_linkage() -> None:
    length_m, top_m, block_m, load_kg = 16.1, (2.0, 4.75), (1.4, 3.325), 20_000.0
    ropes, top = four_ropes(length_m, top_m, block_m, load_kg, 30.0)
    bodies = pivot(site("pivot") + top) + spreader_body(load_kg, block_m, (0.0, 0.0), length_m) + "</body>"
    found_hz = frequencies_hz(plain(bodies, ropes, "spreader"))
    x, y, z = np.square(LOAD_SIZE_M) / 12
    expected_hz = []
    for spacing, lower, turning in ((top_m[0], block_m[0], x + z), (top_m[1], block_m[1], y + z)):
        reach_m, rise_m = linkage(spacing, lower, length_m, LOAD_BELOW_M)
        expected_hz.append(np.sqrt(G_M_S2 * rise_m / (reach_m**2 + turning)) / (2 * np.pi))
    np.testing.assert_allclose(found_hz[[0, 1]], np.sort(expected_hz), rtol=5e-4)
    # About the vertical: the spacings are similar above and below, so that no rope is stretched.
    arms = (top_m[0] * block_m[0] + top_m[1] * block_m[1]) / 4
    skew_hz = np.sqrt(G_M_S2 * arms / (length_m * (x + y))) / (2 * np.pi)
    assert found_hz[2] == pytest.approx(skew_hz, rel=1e-3)
    assert (2 * np.pi * found_hz[0]) ** -2 * G_M_S2 < length_m + LOAD_BELOW_M


def test_two_fixed_falls_swing_at_different_frequencies_in_the_two_planes() -> None:
    length_m, top_m, block_m, sling_m, load_kg = 9.0, 0.7, 0.4, 2.0, 4000.0
    ropes, top, _ = falls_of_block(
        falls=2, fixed=True, length_m=length_m, top_m=top_m, block_m=block_m, gap_m=0.0, hung_kg=load_kg, bounce_hz=8.0
    )
    sling = Rope("sling", ("hook", "load"), sling_m, 2e7, 0.0)
    load = point("load", load_kg, 0.0, -length_m - HOOK_M - sling_m)
    bodies = pivot(site("pivot") + top) + block(40.0, block_m, 0.0, length_m) + load
    found_hz = frequencies_hz(plain(bodies, (*ropes, sling), "block"))
    reach_m, rise_m = linkage(top_m, block_m, length_m, HOOK_M)
    in_plane_m = sling_m + reach_m**2 / rise_m
    expected_hz = np.sqrt(G_M_S2 / np.array([length_m + HOOK_M + sling_m, in_plane_m])) / (2 * np.pi)
    np.testing.assert_allclose(found_hz[:2], expected_hz, rtol=5e-3)


def test_running_rope_lifts_its_block_by_a_share_of_what_is_paid_in() -> None:
    ropes, top, part_m = falls_of_block(
        falls=4, fixed=False, length_m=12.0, top_m=0.8, block_m=0.5, gap_m=0.3, hung_kg=2000.0, bounce_hz=3.0
    )
    load = point("load", 1600.0, 0.0, -12.0 - HOOK_M - 2.0)
    bodies = pivot(site("pivot") + top) + block(400.0, 0.5, 0.3, 12.0) + load
    sling = Rope("sling", ("hook", "load"), 2.0, 2e7, 0.0)
    found_hz = frequencies_hz(plain(bodies, (*ropes, sling), "block"))
    assert np.min(np.abs(found_hz - 3.0)) < 0.15
    assert ropes[0].falls == 4
    assert part_m > 12.0
