"""Error of the four published formulas and of the estimate over the mounting; lead of the predicted maximum; CPU.

`python -m tests.benchmarks.swing FILE.svg` draws the error over the mounting too.
"""

import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from itertools import product
from pathlib import Path

import numpy as np

from devices.simulated import pendulum
from devices.simulated.crane import Crane
from devices.simulated.schedule import TrolleyMove
from gateway.stages.lowpass import LowPass
from gateway.stages.swing import (
    Extremes,
    FormulaAngles,
    MountedHousing,
    Passage,
    SwingEstimate,
    SwingTracker,
    corrected,
    estimate_swing,
    extremes,
    published,
)

GRAVITY_M_S2 = pendulum.STANDARD_GRAVITY_M_S2
RHOS = (0.02, 0.2, 0.5, 0.8, 0.95, 1.0)
AMPLITUDES_DEG = (1.0, 2.0, 4.0, 8.0, 12.0, 20.0)
ELLIPTICITIES = (0.0, 0.5)
NOISES_G = (1e-4, 4e-4, 2.5e-3)
RATE_HZ, SECONDS = 50.0, 90.0
LENGTH_U_REL = 0.1
CUTOFF_HZ, ORDER = 1.0, 2
EQUATIONS = dict(zip((field.name for field in fields(FormulaAngles)), (22, 23, 24, 25), strict=True))
FORMS = ("published", "corrected for rho", "corrected for rho and low-pass")

LIMIT_DEG = 6.0
RUNS, RUN_S, JOG_S = 16, 80.0, 40.0
BLOCK = 16
COUNTS_AFTER_S = 0.25
"""An estimate counts this long after its samples in the gateway."""
K95 = 1.96
RECOVERY_PERIODS = 1.25
"""Until then after a drive or the start there is hardly a swing to predict from."""

PLOT_FLOOR_DEG, PLOT_TOP_DEG = 1e-4, 30.0
COLOURS = {"eq. 22": "#c1272d", "eq. 23": "#d98200", "eq. 24": "#0b7a53", "eq. 25": "#7a4fb5", "estimate": "#0b57a4"}


@dataclass(frozen=True)
class Recordings:
    """All at once: the first dimension is the recording."""

    rho: np.ndarray
    planar: np.ndarray
    length_m: np.ndarray
    noise_g: np.ndarray
    force_g: np.ndarray
    """Shape (recordings, samples, 3)."""
    phi_max_deg: np.ndarray


def main(plot: Path | None = None) -> None:
    """Print the tables; draw the error over the mounting into `plot`."""
    recordings = simulate(np.random.default_rng(2225))
    _print_ideal()
    errors = _print_errors(recordings)
    _print_live()
    if plot is not None:
        plot.write_text(svg(recordings.rho, errors))


def simulate(rng: np.random.Generator) -> Recordings:
    """Every rho with every amplitude, planar and elliptical, every noise; length, azimuth, phase and damping by chance."""
    cases = np.array(list(product(RHOS, AMPLITUDES_DEG, ELLIPTICITIES, NOISES_G)))
    rho, amplitude_deg, ellipticity, noise_g = cases.T
    count = len(cases)
    length_m = rng.uniform(6, 15, count)
    rate_1_s = np.sqrt(GRAVITY_M_S2 / length_m)
    phase, turn = rng.uniform(0, 2 * np.pi, count), np.exp(1j * rng.uniform(0, 2 * np.pi, count))
    a = np.radians(amplitude_deg)
    place = turn * a * (np.cos(phase) + 1j * ellipticity * np.sin(phase))
    speed = turn * a * rate_1_s * (-np.sin(phase) + 1j * ellipticity * np.cos(phase))
    starts = zip(place.real, place.imag, speed.real, speed.imag, strict=True)
    motion = np.array([pendulum.start_motion(*start) for start in starts])
    force_m_s2, angle_rad = _swing(motion, rho * length_m, length_m, rng.uniform(0.001, 0.004, count))
    force_g = force_m_s2 / GRAVITY_M_S2 + noise_g[:, None, None] * rng.normal(size=force_m_s2.shape)
    phi_max_deg = np.array([largest(np.degrees(angles)) for angles in angle_rad])
    return Recordings(rho, ellipticity == 0, length_m, noise_g, force_g, phi_max_deg)


def _swing(
    motion: np.ndarray, position_m: np.ndarray, length_m: np.ndarray, damping_ratio: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Specific force (recordings, samples, 3) and rope angle (recordings, samples) of free swings."""
    length, position = length_m[:, None], position_m[:, None]
    damping_1_s = (2 * damping_ratio * np.sqrt(GRAVITY_M_S2 / length_m))[:, None]

    def rate(_time_s: float, motion: np.ndarray) -> np.ndarray:
        drive = np.array([0.0, 0.0, -GRAVITY_M_S2]) - damping_1_s * length * motion[:, 1]
        return pendulum.motion_rate(motion, drive, length, 0.0)

    forces, angles = [], []
    for _ in range(round(SECONDS * RATE_HZ)):
        n_acceleration = rate(0.0, motion)[:, 1]
        forces.append(pendulum.specific_force_m_s2(motion, n_acceleration, np.zeros(3), GRAVITY_M_S2, position))
        angles.append(np.arctan2(np.hypot(motion[:, 0, 0], motion[:, 0, 1]), -motion[:, 0, 2]))
        motion = pendulum.runge_kutta_step(rate, 0.0, motion, 1 / RATE_HZ)
    return np.stack(forces, axis=1), np.stack(angles, axis=1)


def maxima(angle_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the local maxima, and their heights between the samples (the vertex of a parabola)."""
    a = angle_deg
    place = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:])) + 1
    before, middle, after = a[place - 1], a[place], a[place + 1]
    return place, middle + (before - after) ** 2 / (8 * (2 * middle - before - after))


def largest(angle_deg: np.ndarray) -> float:
    """Largest angle, ends included."""
    return float(max(*maxima(angle_deg)[1], angle_deg[0], angle_deg[-1]))


def _print_ideal() -> None:
    """What the formulas read on an ideal planar swing of 10 degrees along x: no noise, no filter."""
    print("formulas as published on an ideal planar swing of 10 deg, no noise, no filter, deg")
    print("   rho" + "".join(f"   eq. {number}" for number in EQUATIONS.values()))
    phi = np.radians(10.0)
    for rho in RHOS:
        across = float((1 - rho) * np.sin(phi))
        ideal = Extremes(
            max_x_g=across,
            max_y_g=0.0,
            max_across_g=across,
            min_z_g=float(np.cos(phi)),
            max_z_g=float(1 + 2 * rho * (1 - np.cos(phi))),
        )
        print(f"  {rho:4.2f}" + "".join(f"{_degrees(angle):9.2f}" for angle in asdict(published(ideal)).values()))


def _print_errors(recordings: Recordings) -> dict[str, np.ndarray]:
    """Tables of rms errors; the errors of the published formulas and the estimate, deg, each of shape (recordings,)."""
    estimates, cpu_s = _estimates(recordings)
    answers = _formula_answers(recordings)
    print(
        f"\n{len(recordings.rho)} recordings of {SECONDS:.0f} s at {RATE_HZ:.0f} Hz, {AMPLITUDES_DEG[0]:g} to ", end=""
    )
    print(f"{AMPLITUDES_DEG[-1]:g} deg, planar and elliptical, noise {', '.join(f'{1e3 * n:g}' for n in NOISES_G)} mg,")
    print(
        f"rope length believed to {100 * LENGTH_U_REL:.0f} %; rms error of phi_max in deg (+n: n more without an answer)"
    )
    errors = {}
    for form in FORMS:
        print(f"\nfour formulas behind a {CUTOFF_HZ:g} Hz order-{ORDER} low-pass, {form}")
        print(
            "   rho"
            + "".join(f"     eq. {number}   " for number in EQUATIONS.values())
            + "   |  planar ones only: the same"
        )
        found = {number: answers[form, number] - recordings.phi_max_deg for number in EQUATIONS.values()}
        for rho in RHOS:
            at = recordings.rho == rho
            row, planar_row = (
                "".join(_rms(e[chosen]) for e in found.values()) for chosen in (at, at & recordings.planar)
            )
            print(f"  {rho:4.2f}{row}   |{planar_row}")
        if form == FORMS[0]:
            errors = {f"eq. {number}": np.abs(e) for number, e in found.items()}
    errors["estimate"] = _print_estimates(recordings, estimates, cpu_s)
    return errors


def _estimates(recordings: Recordings) -> tuple[list[SwingEstimate], np.ndarray]:
    rng = np.random.default_rng(95)
    time_s = np.arange(recordings.force_g.shape[1]) / RATE_HZ
    estimates, cpu_s = [], []
    for rho, length_m, noise_g, force_g in zip(
        recordings.rho, recordings.length_m, recordings.noise_g, recordings.force_g, strict=True
    ):
        rig = _rig(length_m, rho, rng)
        before_s = time.process_time()
        estimates.append(estimate_swing(time_s, force_g, rig=rig, noise_g=noise_g))
        cpu_s.append(time.process_time() - before_s)
    return estimates, np.array(cpu_s)


def _rig(length_m: float, rho: float, rng: np.random.Generator) -> MountedHousing:
    """The place known, the rope's length believed wrong by its stated uncertainty."""
    belief_m = length_m * (1 + LENGTH_U_REL * rng.normal())
    return MountedHousing(length_m=belief_m, position_m=rho * length_m, length_u_rel=LENGTH_U_REL)


def _formula_answers(recordings: Recordings) -> dict[tuple[str, int], np.ndarray]:
    """Degrees by form and equation, NaN for no answer; rho, period and gain are the true ones."""
    answers = defaultdict(list)
    for rho, length_m, force_g in zip(recordings.rho, recordings.length_m, recordings.force_g, strict=True):
        lowpass = LowPass(CUTOFF_HZ, ORDER, RATE_HZ)
        found = extremes(lowpass.apply(force_g))
        frequency_hz = np.sqrt(GRAVITY_M_S2 / length_m) / (2 * np.pi)
        passage = Passage(gain_f0=lowpass.gain(frequency_hz), gain_2f0=lowpass.gain(2 * frequency_hz))
        for form, angles in zip(
            FORMS, (published(found), corrected(found, rho), corrected(found, rho, passage)), strict=True
        ):
            for name, angle_rad in asdict(angles).items():
                answers[form, EQUATIONS[name]].append(_degrees(angle_rad))
    return {key: np.array(values) for key, values in answers.items()}


def _print_estimates(recordings: Recordings, estimates: list[SwingEstimate], cpu_s: np.ndarray) -> np.ndarray:
    phi_deg, u_deg = (np.array([_degrees(getattr(e, name)) for e in estimates]) for name in ("phi_max_rad", "u_rad"))
    error_deg = phi_deg - recordings.phi_max_deg
    covered = np.array([_covers(e, true_deg) for e, true_deg in zip(estimates, recordings.phi_max_deg, strict=True)])
    print("\nestimate\n   rho   rms error   median u   worst |error|/u   truth in the 95 % interval")
    for rho in RHOS:
        at = recordings.rho == rho
        ratio = np.nanmax(np.abs(error_deg[at]) / u_deg[at])
        print(f"  {rho:4.2f}{_rms(error_deg[at])}{np.nanmedian(u_deg[at]):9.4f}{ratio:14.2f}", end="")
        print(f"{covered[at].sum():18d} of {at.sum()}")
    still, unknown = (sum(e.phi_max_rad is None and e.swinging is said for e in estimates) for said in (False, None))
    print(f"  without an angle: {still} said to be still, with an upper bound; {unknown} unknown")
    median_s = np.median(cpu_s)
    print(f"  all: {covered.sum()} of {len(covered)} covered ({100 * covered.mean():.0f} %)")
    print(f"  CPU per recording: median {1e3 * median_s:.0f} ms, largest {1e3 * cpu_s.max():.0f} ms;", end=" ")
    print(f"per hour of data (mean) {cpu_s.mean() * 3600 / SECONDS:.1f} s")
    return np.abs(error_deg)


def _covers(estimate: SwingEstimate, true_deg: float) -> bool:
    if estimate.coverage95_rad is None:
        return False
    low_deg, high_deg = np.degrees(estimate.coverage95_rad)
    return bool(low_deg <= true_deg <= high_deg)


@dataclass(frozen=True)
class Run:
    """A load followed live."""

    period_s: float
    time_s: np.ndarray
    angle_deg: np.ndarray
    free: np.ndarray
    estimates: list[SwingEstimate]
    cpu_s: list[float]

    def recovering(self, time_s: float) -> bool:
        """Less than RECOVERY_PERIODS after the start or a drive."""
        since_s = time_s - RECOVERY_PERIODS * self.period_s
        return since_s < 0 or not self.free[(self.time_s > since_s) & (self.time_s <= time_s)].all()

    def covered(self) -> Iterator[bool]:
        """Whether the interval of an estimate in free swing holds the truth."""
        for e in self.estimates:
            if e.swinging and e.coverage95_rad is not None and not self.recovering(e.to_s):
                within = (self.time_s > e.from_s) & (self.time_s < e.to_s)
                ends = np.interp([e.from_s, e.to_s], self.time_s, self.angle_deg)
                yield _covers(e, max(largest(self.angle_deg[within]), *ends))


def follow(rng: np.random.Generator) -> Run:
    """A decaying elliptical swing of a little more or less than the limit in a steady wind, and a jog of the trolley."""
    length_m, rho = rng.uniform(7, 12), rng.uniform(0.02, 0.95)
    rate_1_s = np.sqrt(GRAVITY_M_S2 / length_m)
    major, minor = np.radians(rng.uniform(5.6, 7.0)), np.radians(rng.uniform(0, 1.5))
    jog = TrolleyMove(JOG_S, rng.uniform(2, 4), 0.8, rng.uniform(-0.3, 0.3), rng.uniform(0, np.pi))
    crane = Crane(
        length_m=length_m,
        position_m=rho * length_m,
        events=[jog],
        motion=pendulum.start_motion(major, 0.0, 0.0, minor * rate_1_s),
        damping_ratio=0.002,
        wind_m_s2=(rng.uniform(-0.08, 0.08), rng.uniform(-0.08, 0.08)),
    )
    noise_g = float(rng.choice(NOISES_G))
    tracker = SwingTracker(_rig(length_m, rho, rng), noise_g=noise_g)
    time_s = np.arange(round(RUN_S * RATE_HZ)) / RATE_HZ
    truths, estimates, cpu_s = [], [], []
    for block_s in np.split(time_s, range(BLOCK, len(time_s), BLOCK)):
        force_g = crane.specific_force_m_s2(block_s) / GRAVITY_M_S2 + noise_g * rng.normal(size=(len(block_s), 3))
        truths.append(crane.truth(block_s))
        before_s = time.process_time()
        estimate = tracker.update(block_s, force_g)
        if estimate is not None:
            estimates.append(estimate)
            cpu_s.append(time.process_time() - before_s)
    angle_deg = np.degrees(np.concatenate([truth.rope_angle_rad for truth in truths]))
    free = np.concatenate([truth.free for truth in truths])
    return Run(2 * np.pi / rate_1_s, time_s, angle_deg, free, estimates, cpu_s)


@dataclass(frozen=True)
class PeakStory:
    """What was said of one peak of the rope angle before it came."""

    angle_deg: float
    recovering: bool
    predicted: bool
    lead_s: float | None
    """From the first prediction that reached above the limit to the peak; None: there was none."""


def stories(run: Run) -> Iterator[PeakStory]:
    """Every prediction belongs to the true peak nearest to its time; it counts COUNTS_AFTER_S after its samples."""
    said = [(e.to_s, e.to_s + e.prediction.time_to_peak_s, e.prediction) for e in run.estimates if e.prediction]
    for place, angle_deg in zip(*maxima(run.angle_deg), strict=True):
        at_s = float(run.time_s[place])
        early = [
            (at_s - made_s - COUNTS_AFTER_S, np.degrees(p.phi_max_rad + K95 * p.u_rad))
            for made_s, peak_s, p in said
            if abs(peak_s - at_s) < run.period_s / 4 and made_s + COUNTS_AFTER_S < at_s
        ]
        above = [lead_s for lead_s, upper_deg in early if upper_deg > LIMIT_DEG]
        yield PeakStory(float(angle_deg), run.recovering(at_s), bool(early), max(above, default=None))


def _print_live() -> None:
    runs = [follow(np.random.default_rng(7000 + number)) for number in range(RUNS)]
    told = [story for run in runs for story in stories(run)]
    print(
        f"\nlive: {RUNS} runs of {RUN_S:.0f} s, wind, a trolley's jog in each; predicted maximum against {LIMIT_DEG:g} deg"
    )
    print(f"  {len(told)} peaks, {sum(5 <= s.angle_deg <= 7 for s in told)} of them between 5 and 7 deg")
    _print_lead("in free swing", [s for s in told if not s.recovering])
    _print_lead(f"within {RECOVERY_PERIODS:g} swings of the start or a drive", [s for s in told if s.recovering])
    covered = [hit for run in runs for hit in run.covered()]
    print(f"  truth in the 95 % interval of an estimate in free swing: {sum(covered)} of {len(covered)}", end=" ")
    print(f"({100 * np.mean(covered):.0f} %)")
    timed = [(run, e, 1e3 * cpu_s) for run in runs for e, cpu_s in zip(run.estimates, run.cpu_s, strict=True)]
    free_ms = [cpu_ms for run, e, cpu_ms in timed if e.swinging and not run.recovering(e.to_s)]
    p50, p99 = np.percentile(free_ms, [50, 99])
    print(f"  CPU per update in free swing: median {p50:.1f} ms, p99 {p99:.1f} ms, of {len(free_ms)};", end=" ")
    print(f"largest of all {len(timed)}: {max(cpu_ms for _, _, cpu_ms in timed):.0f} ms")
    apart = np.concatenate([np.diff([e.to_s for e in run.estimates if e.swinging]) / run.period_s for run in runs])
    print(f"  updates per swing: {1 / np.median(apart):.1f}")


def _print_lead(when: str, told: list[PeakStory]) -> None:
    above = [s for s in told if s.angle_deg > LIMIT_DEG]
    leads = [s.lead_s for s in above if s.lead_s is not None]
    false = [s.angle_deg for s in told if s.angle_deg <= LIMIT_DEG and s.lead_s is not None]
    below = len(told) - len(above)
    print(f"  {when}: {len(above)} peaks above the limit, {len(above) - len(leads)} without early warning", end=" ")
    print(f"({sum(not s.predicted for s in above)} without any prediction)")
    if leads:
        print(f"    lead time: median {np.median(leads):.2f} s, least {min(leads):.2f} s, most {max(leads):.2f} s")
    missed = [s.angle_deg for s in above if s.predicted and s.lead_s is None]
    if missed:
        print(f"    largest peak that was predicted below the limit: {max(missed):.3f} deg")
    lowest = f", the lowest at {min(false):.3f} deg" if false else ""
    print(f"    false early warnings: {len(false)} of {below} peaks below the limit{lowest}")


def _degrees(angle_rad: float | None) -> float:
    return float("nan") if angle_rad is None else float(np.degrees(angle_rad))


def _rms(error_deg: np.ndarray) -> str:
    """Twelve characters: the rms of what there is, and how often there is nothing."""
    missing = int(np.isnan(error_deg).sum())
    without = f"+{missing}" if missing else ""
    if missing == len(error_deg):
        return f"{'none':>9}   "
    return f"{np.sqrt(np.nanmean(error_deg**2)):9.4f}{without:<3}"


LEFT, RIGHT, TOP, BOTTOM = 70, 590, 50, 400


def svg(rho: np.ndarray, errors: dict[str, np.ndarray]) -> str:
    """Absolute error over rho on a logarithmic axis: a dot for each recording, a line through the rms."""
    drawing = [
        _text(LEFT, 26, "Error of phi_max, formulas as published: dots single recordings, lines rms", 15, "start")
    ]
    drawing += _axes()
    for place, (name, error_deg) in enumerate(errors.items()):
        drawing += _series(rho, error_deg, COLOURS[name], place - (len(errors) - 1) / 2)
        y = TOP + 20 + 24 * place
        drawing.append(f'<path d="M{RIGHT + 20} {y} h26" stroke="{COLOURS[name]}" stroke-width="2.5"/>')
        drawing.append(_text(RIGHT + 54, y + 5, name, 13, "start"))
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 700 450" font-family="sans-serif">'
    return "\n".join([head, '<rect width="700" height="450" fill="#ffffff"/>', *drawing, "</svg>\n"])


def _axes() -> list[str]:
    lines = []
    for exponent in range(-4, 2):
        y = _y(10.0**exponent)
        lines.append(f'<path d="M{LEFT} {y:.1f} H{RIGHT}" stroke="#dddddd"/>')
        lines.append(_text(LEFT - 8, y + 4, f"{10.0**exponent:g}°" if exponent > -4 else "0.0001°", 12, "end"))
    for rho in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        lines.append(f'<path d="M{_x(rho):.1f} {BOTTOM} v5" stroke="#444444"/>')
        lines.append(_text(_x(rho), BOTTOM + 20, f"{rho:g}", 12, "middle"))
    lines.append(f'<path d="M{LEFT} {TOP} V{BOTTOM} H{RIGHT}" stroke="#444444" fill="none"/>')
    lines.append(_text((LEFT + RIGHT) / 2, BOTTOM + 42, "rho: 0 housing at the pivot, 1 at the load", 13, "middle"))
    return lines


def _series(rho: np.ndarray, error_deg: np.ndarray, colour: str, aside: float) -> list[str]:
    """Dots stand a little aside, so that those of one rho can be told apart."""
    known = ~np.isnan(error_deg)
    dots = [
        f'<circle cx="{_x(r) + 4 * aside:.1f}" cy="{_y(e):.1f}" r="2.2"/>'
        for r, e in zip(rho[known], error_deg[known], strict=True)
    ]
    means = [(r, np.sqrt(np.mean(error_deg[known & (rho == r)] ** 2))) for r in RHOS if (known & (rho == r)).any()]
    points = " ".join(f"{_x(r) + 4 * aside:.1f},{_y(e):.1f}" for r, e in means)
    group = [f'<g fill="{colour}" fill-opacity="0.45">', *dots, "</g>"]
    return [*group, f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2.2"/>']


def _x(rho: float) -> float:
    return LEFT + 16 + rho * (RIGHT - LEFT - 32)


def _y(error_deg: float) -> float:
    share = np.log(max(error_deg, PLOT_FLOOR_DEG) / PLOT_FLOOR_DEG) / np.log(PLOT_TOP_DEG / PLOT_FLOOR_DEG)
    return float(BOTTOM - share * (BOTTOM - TOP))


def _text(x: float, y: float, text: str, size: int, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="#222222">{text}</text>'


if __name__ == "__main__":
    main(*(Path(name) for name in sys.argv[1:2]))
