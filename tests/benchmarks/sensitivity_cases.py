"""Small fixed sets of recordings on which the effect of a tuned number is measured, and what counts as an outcome of each.

Recordings are made once and hold plain arrays; what judges them is imported when it is called, so that it can be a moved version.
"""

import contextlib
import io
import json
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.pendulum import start_motion
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_rate_1_s
from devices.simulated.crane import Crane
from devices.simulated.schedule import Event, Gust, Hoist, TrolleyMove
from gateway.numerics.stats import NORMAL_975

Array = NDArray[np.float64]
Outcome = dict[str, Any]
RATE_HZ, SECONDS, UPDATE = 50.0, 36.0, 5
LENGTH_M, NOISE_G, MOUNT_U_RAD = 9.0, 4e-4, 1e-3
CONDITION_SEEDS = (2, 3, 5, 6, 7, 8, 9, 10, 11, 12)
"""One recording of each kind."""
RECONCILE_CASES, RECONCILE_SEED = 12, 71


@dataclass(frozen=True)
class Subject:
    """Modules whose numbers are moved, and what judges a move."""

    packages: Sequence[str]
    cases: Callable[[], Sequence[str]]
    judge: Callable[[str], Outcome]
    """Outcome of a case: by name numbers and words; words are compared, numbers are also held against the truth."""
    default_modules: Sequence[str] = field(default_factory=tuple)


@dataclass(frozen=True)
class SwingCase:
    """A recording of a swing with its truth, and what is stated of its rig."""

    force_g: Array
    angle_rad: Array
    rig: dict[str, Any]
    noise_g: float | None = NOISE_G
    live: bool = False


def _swing_case(
    rho: float,
    amplitude_deg: float,
    *,
    ellipticity: float = 0.0,
    noise_g: float = NOISE_G,
    wind_m_s2: float = 0.0,
    events: Sequence[Event] = (),
    seconds: float = SECONDS,
    spoil: Callable[[Array], Array] = lambda force_g: force_g,
    live: bool = False,
    **rig: Any,
) -> SwingCase:
    turn = np.exp(0.4j)
    amplitude = np.radians(amplitude_deg)
    rate_1_s = small_swing_rate_1_s(LENGTH_M, STANDARD_GRAVITY_M_S2)
    place, speed = amplitude * turn, 1j * ellipticity * amplitude * rate_1_s * turn
    crane = Crane(
        length_m=LENGTH_M,
        position_m=rho * LENGTH_M,
        events=events,
        motion=start_motion(place.real, place.imag, speed.real, speed.imag),
        damping_ratio=0.002,
        wind_m_s2=(wind_m_s2, wind_m_s2 / 2),
    )
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    force_g = crane.specific_force_m_s2(time_s) / STANDARD_GRAVITY_M_S2
    force_g = force_g + noise_g * np.random.default_rng(round(1e4 * rho) + len(events)).normal(size=force_g.shape)
    stated = {"length_m": 1.08 * LENGTH_M, "position_m": rho * LENGTH_M, "length_u_rel": 0.1} | rig
    stated = {name: value for name, value in stated.items() if value is not None}
    return SwingCase(spoil(force_g), crane.truth(time_s).rope_angle_rad, stated, noise_g, live)


def _with_spikes(force_g: Array) -> Array:
    force_g = force_g.copy()
    force_g[[250, 700, 1300]] += [[0.02, 0.0, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.1]]
    return force_g


def _with_dead_y(force_g: Array) -> Array:
    noise_g = NOISE_G * np.random.default_rng(5).normal(size=len(force_g))
    return np.stack([force_g[:, 0], noise_g, force_g[:, 2]], axis=1)


def _with_vibration(force_g: Array) -> Array:
    shaken_g = 0.01 * np.sin(2 * np.pi * 1.7 * np.arange(len(force_g)) / RATE_HZ)
    return np.asarray(force_g + np.stack([0 * shaken_g, shaken_g, 0 * shaken_g], axis=1))


@cache
def swing_recordings() -> dict[str, SwingCase]:
    """Return free and disturbed swings, each with its rig, for the offline and for the live estimator."""
    jog = TrolleyMove(12.0, 3.0, 0.8, 0.25, 0.7)
    below: dict[str, Any] = {"position_m": None, "above_load_m": 0.5 * LENGTH_M}
    return {
        "near the hook": _swing_case(0.05, 8.0),
        "elliptical": _swing_case(0.5, 8.0, ellipticity=0.5),
        "near the load": _swing_case(0.95, 8.0),
        "at the load": _swing_case(1.0, 12.0),
        "noisy and small": _swing_case(0.3, 1.0, noise_g=2.5e-3),
        "wide": _swing_case(0.5, 22.0, noise_g=1e-4),
        "in wind": _swing_case(0.4, 6.0, wind_m_s2=0.6),
        "lowered": _swing_case(0.5, 7.0, events=[Hoist(12.0, 9.0, 2.5)], **below),
        "raised": _swing_case(0.5, 7.0, events=[Hoist(12.0, 9.0, -2.0)], **below),
        "trolley moves": _swing_case(0.5, 5.0, events=[jog]),
        "at rest": _swing_case(0.5, 0.0),
        "at rest at the load": _swing_case(1.0, 0.0),
        "gusts on a hanging load": _swing_case(
            0.3, 0.0, events=[Gust(5.0, 4.0, 0.05, 0.3), Gust(15.0, 3.0, 0.05, 2.0)]
        ),
        "dead y": _swing_case(0.4, 6.0, spoil=_with_dead_y),
        "place stated wrong": _swing_case(0.5, 8.0, position_m=0.42 * LENGTH_M),
        "offset and cross-axis": _swing_case(
            0.5,
            5.0,
            spoil=lambda force_g: force_g + np.array([0.004, -0.003, 0.005]),
            zero_g_offset_u_g=(5e-3,) * 3,
            scale_u=(3e-3,) * 3,
            cross_axis_u=0.01,
        ),
        "clipped": _swing_case(0.5, 15.0, spoil=lambda force_g: np.minimum(force_g, 1.02)),
        "spikes": _swing_case(0.5, 5.0, spoil=_with_spikes),
        "one axis shaken": _swing_case(0.3, 6.0, spoil=_with_vibration),
        "short": _swing_case(0.5, 8.0, seconds=8.0),
        "faint at the load": _swing_case(1.0, 1.3),
        "narrow band": _swing_case(0.6, 8.0, bandwidth_hz=2.0),
        "live: jog in wind": _swing_case(0.3, 5.0, ellipticity=0.2, wind_m_s2=0.08, events=[jog], live=True),
        "live: lowered": _swing_case(0.6, 6.0, events=[Hoist(14.0, 8.0, 2.0)], live=True, **below),
        "live: place stated wrong": _swing_case(0.6, 6.0, seconds=20.0, position_m=0.5 * LENGTH_M, live=True),
        "live: at rest, then swinging": _swing_case(
            0.5, 0.0, events=[TrolleyMove(14.0, 4.0, 1.0, 0.3, 0.2)], live=True
        ),
    }


def judge_swing(name: str) -> Outcome:
    """Return whether there is an angle, what it is worth, and live how often."""
    case = swing_recordings()[name]
    return _judge_live(case) if case.live else _judge_offline(case)


def _judge_offline(case: SwingCase) -> Outcome:
    from gateway.swing.offline import estimate_swing  # noqa: PLC0415
    from gateway.swing.rig import MountedHousing  # noqa: PLC0415

    time_s = np.arange(len(case.force_g)) / RATE_HZ
    e = estimate_swing(time_s, case.force_g, rig=MountedHousing(**case.rig), noise_g=case.noise_g)
    inside = (time_s >= e.from_s - 1e-9) & (time_s <= e.to_s + 1e-9)
    true_rad = float(case.angle_rad[inside].max(initial=0.0))
    state = {True: "swing", False: "none", None: "unknown"}[e.swinging]
    if e.coverage95_rad is None:
        return {"states": {f"{state}, no interval": 1}, "errors_deg": [], "widths_deg": []}
    low, high = e.coverage95_rad
    covered = "covered" if low <= true_rad <= high else "not covered"
    error_deg = 0.0 if e.phi_max_rad is None else float(np.degrees(e.phi_max_rad - true_rad))
    return {
        "states": {f"{state}, {covered}": 1},
        "errors_deg": [error_deg],
        "widths_deg": [float(np.degrees(high - low))],
    }


def _judge_live(case: SwingCase) -> Outcome:
    from gateway.motion.motion_monitor import MotionMonitor  # noqa: PLC0415
    from gateway.swing.rig import MountedHousing  # noqa: PLC0415

    monitor = MotionMonitor(MountedHousing(**case.rig), mount_u_rad=MOUNT_U_RAD, noise_g=case.noise_g)
    states, errors, widths = Counter[str](), [], []
    for begin in range(0, len(case.force_g), UPDATE):
        end = min(begin + UPDATE, len(case.force_g))
        monitor.update(np.arange(begin, end) / RATE_HZ, case.force_g[begin:end])
        e = monitor.estimate((end - 1) / RATE_HZ)
        if e.angle_rad is None or e.u_rad is None:
            states[f"{e.state}, no interval"] += 1
            continue
        error_rad = e.angle_rad - case.angle_rad[end - 1]
        states[f"{e.state}, {'covered' if abs(error_rad) <= NORMAL_975 * e.u_rad else 'not covered'}"] += 1
        widths.append(float(np.degrees(2 * NORMAL_975 * e.u_rad)))
        errors.append(float(np.degrees(error_rad)))
    return {"states": dict(states), "errors_deg": errors, "widths_deg": widths}


def judge_conditions(name: str) -> Outcome:
    """Return how often each verdict and cause was said of what is true, and how often that is right."""
    from tests.benchmarks.conditions import judge  # noqa: PLC0415

    rows = judge(_condition_recording(int(name)))
    states = Counter(f"{kind}: {verdict}, {cause}" for kind, _, _, _, verdict, cause in rows)
    wrong = sum(counts and verdict not in right for _, right, _, counts, verdict, _ in rows)
    return {"states": dict(states), "errors_deg": [float(wrong)], "widths_deg": []}


@cache
def _condition_recording(seed: int) -> Any:
    from tests.benchmarks.condition_recordings import make  # noqa: PLC0415

    return make(seed)


@cache
def _reconcile_folder() -> Path:
    """Make the first cases of a blind campaign, in a folder that stays as long as this process."""
    from tests.blind.cases import generate  # noqa: PLC0415
    from tests.blind.plan import plan_cases  # noqa: PLC0415
    from tests.blind.write import write_case  # noqa: PLC0415

    folder = Path(tempfile.mkdtemp(prefix="sensitivity-"))
    for number, plan in enumerate(plan_cases(RECONCILE_CASES, RECONCILE_SEED)):
        write_case(generate(plan), folder / f"case_{number:03d}")
    return folder


def judge_reconcile(name: str) -> Outcome:
    """Return the verdict and the names of the effects."""
    from gateway.cli.main import main  # noqa: PLC0415

    folder = _reconcile_folder() / name
    out = folder / "out.json"
    arguments = [str(folder / "log.csv"), "--rig", str(folder / "rig.toml"), "--held-out", str(folder / "held_out.csv")]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main(["reconcile", *arguments, "--json", str(out)])
    found = json.loads(out.read_text())
    names = sorted(effect["name"] for effect in found["effects"])
    return {"states": {f"{found['verdict']}: {', '.join(names)}": 1}, "errors_deg": [], "widths_deg": []}


SUBJECTS = {
    "swing": Subject(("gateway.swing", "gateway.motion"), lambda: list(swing_recordings()), judge_swing),
    "conditions": Subject(("gateway.stages",), lambda: [str(seed) for seed in CONDITION_SEEDS], judge_conditions),
    "reconcile": Subject(
        ("gateway.twin.reconcile",),
        lambda: [f"case_{number:03d}" for number in range(RECONCILE_CASES)],
        judge_reconcile,
    ),
}
