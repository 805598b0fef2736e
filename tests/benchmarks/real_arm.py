"""The arm's encoder as a housing at its pivot would read it, and models of the twin fitted to that.

The recording is of an arm of 0.15 m that swings once in 0.8 s. Times are stretched by 10 and lengths by 100, which leaves every
angle as measured (Froude's similarity): what comes out is a crane of 15 m, for which the twin's bands and durations are made.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.parameter import Value
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.initial_conditions import segment_initial_conditions
from gateway.twin.reconcile.fit.multiple_shooting import FitProblem, fit_model
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
DATA = Path(__file__).parents[1] / "data" / "real_pendulum" / "arm_angle.csv"
GRAVITY_M_S2 = 9.80665
LONGER = (1, 1 / 16, 11 / 3072, 173 / 737280, 22931 / 1321205760)
"""T/T0 of a pendulum, in powers of the amplitude's square."""
STRETCH = 10.0
"""Of times; lengths go with its square."""
NOISE_G = 1e-4
"""A round figure above the encoder's local scatter of 33 to 37 microradians."""
PIECE_S = 1.5
"""Of the arm's time, two swings: pieces with starts of their own, from which the one motion is then fitted."""
ROUNDS = 30
FIRST_VALUES: dict[str, dict[str, Value]] = {"coulomb_friction": {"decel_m_s2": 0.01}}


@dataclass(frozen=True, slots=True)
class Swing:
    """A stretch of the arm's motion, n samples."""

    time_s: Array
    """Of the arm."""
    angle_rad: Array

    def observations(self) -> Observations:
        """Specific force at the pivot, the swing along x, at a crane's time."""
        across = np.zeros_like(self.angle_rad)
        force_g = np.stack([np.sin(self.angle_rad), across, np.cos(self.angle_rad)], axis=1)
        elapsed = STRETCH * (self.time_s - self.time_s[0])
        return Observations(elapsed, force_g, None, np.full(3, NOISE_G), np.ones(len(elapsed), dtype=bool))

    def csv(self, heading_rad: float = np.pi / 4) -> str:
        """The same as a recording, the housing turned against the plane of the swing so that both lateral axes read it."""
        lateral = np.sin(self.angle_rad)
        columns = [
            STRETCH * (self.time_s - self.time_s[0]),
            lateral * np.cos(heading_rad),
            lateral * np.sin(heading_rad),
            np.cos(self.angle_rad),
        ]
        rows = (",".join(f"{number:.7f}" for number in row) for row in np.stack(columns, axis=1))
        return "\n".join(["time_s,ax_g,ay_g,az_g", *rows]) + "\n"


def read_swings(path: Path = DATA) -> tuple[Swing, Swing]:
    """What is fitted and what is held out; the first begins at a passage through the lowest point."""
    time_s, angle_rad, held_out = np.loadtxt(path, delimiter=",", skiprows=1).T
    first = passages(angle_rad)[0]
    log, after = slice(first, int(np.argmax(held_out > 0))), held_out > 0
    return Swing(time_s[log], angle_rad[log]), Swing(time_s[after], angle_rad[after])


def passages(angle_rad: Array) -> NDArray[np.int64]:
    """Samples next after each passage through the lowest point."""
    return np.flatnonzero(np.diff(np.sign(angle_rad))) + 1


def believed_length_m(swing: Swing) -> float:
    """g T0^2/(2 pi)^2 of an arm: its inertia over its imbalance, from the last ten periods; of the crane it stands for.

    A period at an amplitude is longer by `LONGER`, good to 4e-4 at 90 degrees.
    """
    at = passages(swing.angle_rad)[-21:]
    before, after = swing.angle_rad[at - 1], swing.angle_rad[at]
    time_s = swing.time_s[at] - (swing.time_s[at] - swing.time_s[at - 1]) * after / (after - before)
    amplitude = np.array([np.abs(swing.angle_rad[a:b]).max() for a, b in itertools.pairwise(at)])
    longer = float(np.mean(np.polynomial.polynomial.polyval(amplitude**2, LONGER)))
    period_s = STRETCH * float(time_s[-1] - time_s[0]) / 10 / longer
    return GRAVITY_M_S2 * (period_s / (2 * np.pi)) ** 2


def rig_of(log: Swing) -> TwinRig:
    """Belief before any effect is looked for."""
    return TwinRig(believed_length_m(log), 0.0, GRAVITY_M_S2, (NOISE_G, NOISE_G, NOISE_G))


def rig_toml(log: Swing) -> str:
    """The same as a file."""
    rate_hz = 1 / (STRETCH * float(np.median(np.diff(log.time_s))))
    return (
        f"[rope]\nlength_m = {believed_length_m(log):.5f}\n[housing]\nposition_m = 0.0\n"
        f"[sensor]\nsample_rate_hz = {rate_hz:.6g}\nnoise_g = {NOISE_G}\n"
    )


def angle_of(force_g: Array) -> Array:
    """Angle of the plane swing that a housing at the pivot reads, whatever way it is turned; rad, shape (n,)."""
    lateral = np.hypot(force_g[:, 0], force_g[:, 1]) * np.sign(force_g[:, 0])
    found: Array = np.arctan2(lateral, force_g[:, 2])
    return found


def cut(swing: Swing, seconds: float) -> list[int]:
    """First samples of about equal pieces of about this length; each but the first begins at a passage."""
    count = max(1, round(float(swing.time_s[-1] - swing.time_s[0]) / seconds))
    at = passages(swing.angle_rad)
    wanted = swing.time_s[0] + (swing.time_s[-1] - swing.time_s[0]) * np.arange(1, count) / count
    nearest = [int(at[np.argmin(np.abs(swing.time_s[at] - each))]) for each in wanted]
    return sorted({0, *nearest})


def follow_in_windows(simulator: Simulator, swing: Swing, effects: Array, firsts: Sequence[int]) -> tuple[Array, Array]:
    """Each window with a start of its own, all with the same effects: starts, and the simulated force (n, 3)."""
    o = swing.observations()
    starts = segment_initial_conditions(simulator, o, effects, firsts)
    return starts, simulator.linearise_segments(starts, effects, o.time_s, firsts).force_g


def error_mrad(swing: Swing, force_g: Array) -> float:
    """Root mean square of simulated - measured angle."""
    return 1e3 * float(np.sqrt(np.mean((angle_of(force_g) - swing.angle_rad) ** 2)))


@dataclass(frozen=True, slots=True)
class FittedArm:
    """Effects fitted to the log as one motion."""

    simulator: Simulator
    effects: Array
    log_mrad: float
    piecewise_mrad: float
    """What is left on the log where each piece has a start of its own."""

    def held_out_mrad(self, held_out: Swing, window_s: float) -> float:
        """Only the starts of windows of about this length (of the arm's time) are fitted again."""
        return error_mrad(
            held_out, follow_in_windows(self.simulator, held_out, self.effects, cut(held_out, window_s))[1]
        )


def fit_arm(rig: TwinRig, log: Swing, names: Sequence[str]) -> FittedArm:
    """These effects and the rope's length: by multiple shooting as one motion over the whole log, from pieces."""
    simulator = Simulator(rig, sorted({"rope_length", *names}))
    chosen = {name: values for name, values in FIRST_VALUES.items() if name in names}
    effects = simulator.values([], chosen)[simulator.n_initial_states :]
    firsts = cut(log, PIECE_S)
    starts, _ = follow_in_windows(simulator, log, effects, firsts)
    free = np.array([slot.name != "heading_rad" for slot in simulator.parameters])
    fit = fit_model(FitProblem(simulator, log.observations(), free, firsts), starts, effects, ROUNDS)
    effects = fit.values[simulator.n_initial_states :]
    _, force_g = follow_in_windows(simulator, log, effects, firsts)
    return FittedArm(simulator, effects, error_mrad(log, fit.force_g), error_mrad(log, force_g))
