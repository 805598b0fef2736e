"""How early the coming maximum is known live, how often the live interval holds, and what an update costs."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from devices.pendulum import pendulum
from devices.simulated.crane import Crane
from devices.simulated.schedule import TrolleyMove
from gateway.motion.estimate import MotionEstimate
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.stats import NORMAL_975
from tests.benchmarks.swing_cases import GRAVITY_M_S2, NOISES_G, RATE_HZ, maxima, rig

LIMIT_DEG = 6.0
RUNS, RUN_S, JOG_S = 16, 80.0, 40.0
BLOCK = 5
"""Samples between two updates."""
MOUNT_U_RAD = 1e-3
RECOVERY_PERIODS = 1.25
"""Until then after a drive or the start there is hardly a swing to predict from."""


@dataclass(frozen=True)
class Run:
    """A load followed live."""

    period_s: float
    time_s: np.ndarray
    angle_deg: np.ndarray
    free: np.ndarray
    estimates: list[MotionEstimate]
    cpu_s: list[float]

    def recovering(self, time_s: float) -> bool:
        """Less than RECOVERY_PERIODS after the start or a drive."""
        since_s = time_s - RECOVERY_PERIODS * self.period_s
        return since_s < 0 or not self.free[(self.time_s > since_s) & (self.time_s <= time_s)].all()

    def covered(self) -> Iterator[bool]:
        """Whether the interval of an angle in free swing holds the truth."""
        for e in self.estimates:
            if e.angle_rad is not None and e.u_rad is not None and not self.recovering(e.time_s):
                true_rad = np.radians(np.interp(e.time_s, self.time_s, self.angle_deg))
                yield bool(abs(e.angle_rad - true_rad) < NORMAL_975 * e.u_rad)


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
    monitor = MotionMonitor(rig(length_m, rho, rng), mount_u_rad=MOUNT_U_RAD, noise_g=noise_g)
    time_s = np.arange(round(RUN_S * RATE_HZ)) / RATE_HZ
    truths, estimates, cpu_s = [], [], []
    for block_s in np.split(time_s, range(BLOCK, len(time_s), BLOCK)):
        force_g = crane.specific_force_m_s2(block_s) / GRAVITY_M_S2 + noise_g * rng.normal(size=(len(block_s), 3))
        truths.append(crane.truth(block_s))
        before_s = time.process_time()
        monitor.update(block_s, force_g)
        estimates.append(monitor.estimate(float(block_s[-1])))
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
    """Every prediction belongs to the true peak nearest to its time."""
    said = [(e.time_s, e.time_s + p.in_s, p) for e in run.estimates if (p := e.expected_peak) is not None]
    for place, angle_deg in zip(*maxima(run.angle_deg), strict=True):
        at_s = float(run.time_s[place])
        early = [
            (at_s - made_s, np.degrees(p.upper_rad(NORMAL_975)))
            for made_s, peak_s, p in said
            if abs(peak_s - at_s) < run.period_s / 4 and made_s < at_s
        ]
        above = [lead_s for lead_s, upper_deg in early if upper_deg > LIMIT_DEG]
        yield PeakStory(float(angle_deg), run.recovering(at_s), bool(early), max(above, default=None))


def print_live() -> None:
    runs = [follow(np.random.default_rng(7000 + number)) for number in range(RUNS)]
    told = [story for run in runs for story in stories(run)]
    print(
        f"\nlive: {RUNS} runs of {RUN_S:.0f} s, wind, a trolley's jog in each; predicted maximum against {LIMIT_DEG:g} deg"
    )
    print(f"  {len(told)} peaks, {sum(5 <= s.angle_deg <= 7 for s in told)} of them between 5 and 7 deg")
    _print_lead("in free swing", [s for s in told if not s.recovering])
    _print_lead(f"within {RECOVERY_PERIODS:g} swings of the start or a drive", [s for s in told if s.recovering])
    covered = [hit for run in runs for hit in run.covered()]
    print(f"  truth in the 95 % interval of an angle in free swing: {sum(covered)} of {len(covered)}", end=" ")
    print(f"({100 * np.mean(covered):.0f} %)")
    cpu_ms = 1e3 * np.concatenate([run.cpu_s for run in runs])
    p50, p99 = np.percentile(cpu_ms, [50, 99])
    print(f"  CPU per update: median {p50:.1f} ms, p99 {p99:.1f} ms, largest of {len(cpu_ms)}: {cpu_ms.max():.0f} ms")


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
