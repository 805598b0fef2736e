"""Error of the four published formulas and of the estimate over the mounting; lead of the predicted maximum; CPU.

`python -m tests.benchmarks.swing FILE.svg` draws the error over the mounting too.
"""

import sys
import time
from collections import defaultdict
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from gateway.stages.lowpass import LowPass
from gateway.swing.estimate import FormulaAngles, SwingEstimate
from gateway.swing.formulas import Extremes, LowpassGain, as_published, corrected, extremes
from gateway.swing.offline import estimate_swing
from tests.benchmarks.swing_cases import (
    AMPLITUDES_DEG,
    GRAVITY_M_S2,
    LENGTH_U_REL,
    NOISES_G,
    RATE_HZ,
    RHOS,
    SECONDS,
    Recordings,
    covers,
    rig,
    simulate,
)
from tests.benchmarks.swing_live import print_live
from tests.benchmarks.swing_plot import svg
from tests.values import present

CUTOFF_HZ, ORDER = 1.0, 2
EQUATIONS = dict(zip((field.name for field in fields(FormulaAngles)), (22, 23, 24, 25), strict=True))
FORMS = ("published", "corrected for rho", "corrected for rho and low-pass")


def main(plot: Path | None = None) -> None:
    """Print the tables; draw the error over the mounting into `plot`."""
    recordings = simulate(np.random.default_rng(2225))
    _print_ideal()
    errors = _print_errors(recordings)
    print_live()
    if plot is not None:
        plot.write_text(svg(recordings.rho, errors))


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
        print(f"  {rho:4.2f}" + "".join(f"{degrees(angle):9.2f}" for angle in asdict(as_published(ideal)).values()))


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
                "".join(rms(e[chosen]) for e in found.values()) for chosen in (at, at & recordings.planar)
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
        believed = rig(length_m, rho, rng)
        before_s = time.process_time()
        estimates.append(estimate_swing(time_s, force_g, rig=believed, noise_g=noise_g))
        cpu_s.append(time.process_time() - before_s)
    return estimates, np.array(cpu_s)


def _formula_answers(recordings: Recordings) -> dict[tuple[str, int], np.ndarray]:
    """Degrees by form and equation, NaN for no answer; rho, period and gain are the true ones."""
    answers = defaultdict(list)
    for rho, length_m, force_g in zip(recordings.rho, recordings.length_m, recordings.force_g, strict=True):
        lowpass = LowPass(CUTOFF_HZ, ORDER, RATE_HZ)
        found = present(extremes(lowpass.apply(force_g)))
        frequency_hz = np.sqrt(GRAVITY_M_S2 / length_m) / (2 * np.pi)
        passage = LowpassGain(gain_f0=lowpass.gain(frequency_hz), gain_2f0=lowpass.gain(2 * frequency_hz))
        for form, angles in zip(
            FORMS, (as_published(found), corrected(found, rho), corrected(found, rho, passage)), strict=True
        ):
            for name, angle_rad in asdict(angles).items():
                answers[form, EQUATIONS[name]].append(degrees(angle_rad))
    return {key: np.array(values) for key, values in answers.items()}


def _print_estimates(recordings: Recordings, estimates: list[SwingEstimate], cpu_s: np.ndarray) -> np.ndarray:
    phi_deg, u_deg = (np.array([degrees(getattr(e, name)) for e in estimates]) for name in ("phi_max_rad", "u_rad"))
    error_deg = phi_deg - recordings.phi_max_deg
    covered = np.array([covers(e, true_deg) for e, true_deg in zip(estimates, recordings.phi_max_deg, strict=True)])
    print("\nestimate\n   rho   rms error   median u   worst |error|/u   truth in the 95 % interval")
    for rho in RHOS:
        at = recordings.rho == rho
        ratio = np.nanmax(np.abs(error_deg[at]) / u_deg[at])
        print(f"  {rho:4.2f}{rms(error_deg[at])}{np.nanmedian(u_deg[at]):9.4f}{ratio:14.2f}", end="")
        print(f"{covered[at].sum():18d} of {at.sum()}")
    still, unknown = (sum(e.phi_max_rad is None and e.swinging is said for e in estimates) for said in (False, None))
    print(f"  without an angle: {still} said to be still, with an upper bound; {unknown} unknown")
    median_s = np.median(cpu_s)
    print(f"  all: {covered.sum()} of {len(covered)} covered ({100 * covered.mean():.0f} %)")
    print(f"  CPU per recording: median {1e3 * median_s:.0f} ms, largest {1e3 * cpu_s.max():.0f} ms;", end=" ")
    print(f"per hour of data (mean) {cpu_s.mean() * 3600 / SECONDS:.1f} s")
    return np.asarray(np.abs(error_deg))


def degrees(angle_rad: float | None) -> float:
    return float("nan") if angle_rad is None else float(np.degrees(angle_rad))


def rms(error_deg: np.ndarray) -> str:
    """Twelve characters: the rms of what there is, and how often there is nothing."""
    missing = int(np.isnan(error_deg).sum())
    without = f"+{missing}" if missing else ""
    if missing == len(error_deg):
        return f"{'none':>9}   "
    return f"{np.sqrt(np.nanmean(error_deg**2)):9.4f}{without:<3}"


if __name__ == "__main__":
    main(*(Path(name) for name in sys.argv[1:2]))
