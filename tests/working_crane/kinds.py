"""The kinds of cases: `plain` and `hook` are like the given recordings, the others are harder in one respect each."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.blind.mechanics import Hook
from tests.working_crane import draw
from tests.working_crane.crane import DURATION_S, G_M_S2, Case, Crane, Fault, HeavyRope, Jib, SensorErrors
from tests.working_crane.draw import Timeline
from tests.working_crane.events import Drive, Event, JibTrolley, Luff, Slew, SteppedHoist, Wind

RHOS = (0.05, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9)
RHO_SHARES = (0.06, 0.16, 0.14, 0.22, 0.14, 0.16, 0.12)
NOISES_G = (0.0001, 0.0004, 0.001)
WIDEST_DEG = 18.0, 27.0
"""Largest angle of a `wide` case."""


def plain(seed: int) -> Case:
    """Drives, hoists and gusts like those of the given recordings."""
    return _case("plain", seed)


def hook(seed: int) -> Case:
    """A hook block whose load swings below it; no hoists. In half of the cases the load starts in line with the rope."""
    case = _case("hook", seed, parts=(draw.WITHOUT_HOIST, draw.WITHOUT_HOIST_SHARES))
    rng = _more(seed)
    rigging = float(rng.uniform(0.12, 0.25))
    block = Hook(rigging * case.crane.length_m, float(rng.uniform(0.07, 0.15)))
    initial = np.radians(rng.uniform(0.3, 0.8)) if rng.random() < 0.5 else 0.0
    azimuth = rng.uniform(0, 2 * np.pi)
    rho = min(case.rho, 0.95 * (1 - rigging))
    return replace(
        case,
        rho=rho,
        crane=replace(case.crane, hook=block, above_load_m=(1 - rho) * case.crane.length_m),
        rigging_tilt_rad=(float(initial * np.cos(azimuth)), float(initial * np.sin(azimuth))),
        extra={"initial_deg": float(np.degrees(initial))},
    )


def slew(seed: int) -> Case:
    """A slewing jib with a trolley on it; the housing turns with the jib."""

    def slewing(timeline: Timeline) -> None:
        ramp_s = timeline.uniform(0.4, 1.0) * timeline.period_s
        turn = Slew(timeline.end_s, ramp_s, timeline.uniform(0, 2) * timeline.period_s, timeline.signed(0.02, 0.08))
        timeline.add(turn)
        if timeline.rng.random() < 0.3:
            radial(timeline, turn.start_s + timeline.uniform(0, 1) * ramp_s)

    def radial(timeline: Timeline, start_s: float) -> None:
        ramp_s, hold_s = timeline.uniform(0.4, 1.0) * timeline.period_s, timeline.uniform(0, 0.8) * timeline.period_s
        speed = timeline.signed(0.3, 1.2)
        radius_m = 30 + sum(e.speed_m_s * (e.ramp_s + e.hold_s) for e in timeline.events if isinstance(e, JibTrolley))
        if not 15 < radius_m + speed * (ramp_s + hold_s) < 45:
            speed = -speed
        timeline.add(JibTrolley(start_s, ramp_s, hold_s, speed))

    parts = (slewing, lambda timeline: radial(timeline, timeline.end_s), draw.hoisting, draw.gust)
    case = _case("slew", seed, parts=(parts, (0.6, 0.2, 0.1, 0.1)))
    return replace(case, crane=replace(case.crane, jib=Jib(radius_m=30.0)))


def luff(seed: int) -> Case:
    """A luffing boom that also slews: the pivot moves horizontally and vertically."""
    rng = _more(seed)
    boom_m, elevation = float(rng.uniform(25, 50)), float(rng.uniform(0.7, 1.1))

    def luffing(timeline: Timeline) -> None:
        ramp_s, hold_s = timeline.uniform(0.4, 1.0) * timeline.period_s, timeline.uniform(0, 1.2) * timeline.period_s
        rate = timeline.signed(0.008, 0.03)
        now = elevation + sum(e.rate_rad_s * (e.ramp_s + e.hold_s) for e in timeline.events if isinstance(e, Luff))
        if not 0.5 < now + rate * (ramp_s + hold_s) < 1.3:
            rate = -rate
        timeline.add(Luff(timeline.end_s, ramp_s, hold_s, rate))

    def slewing(timeline: Timeline) -> None:
        ramp_s = timeline.uniform(0.5, 1.0) * timeline.period_s
        hold_s = timeline.uniform(0, 1.5) * timeline.period_s
        timeline.add(Slew(timeline.end_s, ramp_s, hold_s, timeline.signed(0.02, 0.06)))

    case = _case("luff", seed, parts=((luffing, slewing, draw.hoisting), (0.65, 0.2, 0.15)))
    return replace(case, crane=replace(case.crane, jib=Jib(boom_m=boom_m, elevation_rad=elevation)))


def stepped_hoist(seed: int) -> Case:
    """Hoists whose speed comes in steps, with ramps of 0.3 s."""

    def stepped(timeline: Timeline) -> None:
        by_m = draw.hoist_m(timeline)
        speeds = np.sort(timeline.rng.uniform(0.05, 0.5, size=int(timeline.rng.integers(1, 4))))
        speeds = np.concatenate([speeds, speeds[-2::-1]])
        holds = timeline.rng.uniform(0.8, 4.0, size=len(speeds))
        holds = np.maximum(holds * abs(by_m) / (speeds @ holds), 0.4)
        speeds = speeds * by_m / (speeds @ holds)
        timeline.add(SteppedHoist(timeline.end_s, 0.3, tuple(holds.tolist()), tuple(speeds.tolist())))

    return _case("stepped_hoist", seed, parts=((stepped, draw.driving_without_hoist, draw.gust), (0.45, 0.45, 0.1)))


def spin(seed: int) -> Case:
    """A housing that turns slowly about the rope."""
    case, rng = _case("spin", seed), _more(seed)
    rate = float(rng.uniform(0.02, 0.1) * rng.choice([-1, 1]))
    return replace(case, crane=replace(case.crane, spin_rad_s=rate), extra={"spin_rad_s": rate})


def string(seed: int) -> Case:
    """A rope with mass that vibrates as a string after hasty starts; no hoists."""

    def hasty(timeline: Timeline) -> None:
        ramp_s, hold_s = timeline.uniform(0.3, 0.9), timeline.uniform(0.3, 1.5) * timeline.period_s
        speed = timeline.signed(0.08, 0.35)
        timeline.add(Drive(timeline.end_s, ramp_s, hold_s, speed, timeline.azimuth_rad()))

    case = _case("string", seed, parts=((hasty, draw.driving_without_hoist, draw.gust), (0.5, 0.35, 0.15)))
    rng = _more(seed)
    share = float(rng.uniform(0.02, 0.1))
    string_rad_s = float(np.pi * np.sqrt(G_M_S2 * (1 + share / 2) / (case.crane.length_m * share)))
    damping = 2 * float(rng.uniform(0.005, 0.02)) * string_rad_s
    return replace(
        case,
        crane=replace(case.crane, rope=HeavyRope(share, damping)),
        extra={"rope_mass_ratio": share, "string_hz": string_rad_s / (2 * np.pi)},
    )


def mid_manoeuvre(seed: int) -> Case:
    """A recording that begins in the middle of a ramp, with a swing already there."""
    case, rng = _case("mid_manoeuvre", seed), _more(seed)
    timeline = Timeline(rng, case.crane.length_m, case.crane.above_load_m, [], rope_m=case.crane.length_m)
    lead_in_s = 4 * timeline.period_s
    before = replace(draw.drive(timeline), start_s=-lead_in_s + 1)
    during = draw.drive(timeline)
    ramp = during.ramp_s * timeline.uniform(0.2, 0.8)
    start_s = -ramp if rng.random() < 0.5 else -ramp - during.ramp_s - during.hold_s
    during = replace(during, start_s=start_s)
    shift_s = max(0.0, during.end_s + timeline.uniform(0, 3) - case.events[0].start_s)
    later = [replace(event, start_s=event.start_s + shift_s) for event in case.events]
    return replace(case, events=draw.in_order([before, during, *later]), lead_in_s=max(lead_in_s, 1 - during.start_s))


def faults(seed: int) -> Case:
    """Gaps, clipped runs, impacts and lost samples."""
    case, rng = _case("faults", seed), _more(seed)

    def several(
        kind: str, count: int, shortest_s: float, longest_s: float, least_g: float, most_g: float
    ) -> list[Fault]:
        found = []
        for _ in range(count):
            direction = rng.normal(size=3)
            size = rng.uniform(least_g, most_g) * direction / np.linalg.norm(direction)
            start, duration = rng.uniform(12, DURATION_S - 10), rng.uniform(shortest_s, longest_s)
            found.append(Fault(kind, float(start), float(duration), tuple(size.tolist())))
        return found

    drawn = several("gap", int(rng.integers(2, 6)), 0.5, 8.0, 0, 0)
    drawn += several("clipped", int(rng.integers(1, 4)), 0.1, 0.6, 3, 6)
    drawn += several("impact", int(rng.integers(3, 10)), 0.02, 0.06, 0.1, 2)
    lost = float(rng.choice([0.0, 0.002, 0.02]))
    sensor = replace(case.sensor, faults=tuple(sorted(drawn, key=lambda f: f.start_s)), lost_fraction=lost)
    return replace(case, sensor=sensor)


def thermal(seed: int) -> Case:
    """Zero-g offsets that drift by up to 2 mg."""
    case, rng = _case("thermal", seed), _more(seed)
    x, y, z = (rng.uniform(0.0005, 0.002, size=3) * rng.choice([-1, 1], size=3)).tolist()
    return replace(
        case, sensor=replace(case.sensor, drift_g=(x, y, z), drift_time_constant_s=float(rng.uniform(40, 300)))
    )


def wide(seed: int) -> Case:
    """Swings to 25 deg: hasty long moves. The largest angle is checked by the simulation."""

    def hasty(timeline: Timeline) -> None:
        draw.drive(timeline, (0.25, 0.9), 4.0)

    return _case("wide", seed, parts=((hasty, draw.hoisting, draw.gust), (0.75, 0.1, 0.15)))


def steady_wind(seed: int) -> Case:
    """A lean of up to 2.5 deg that begins slowly and stays."""
    case, rng = _case("steady_wind", seed), _more(seed)
    start, rise, accel = rng.uniform(10, 60), rng.uniform(20, 80), rng.uniform(0.1, 0.43)
    wind = Wind(float(start), float(rise), float(accel), float(rng.uniform(0, 2 * np.pi)))
    return replace(case, events=draw.in_order([*case.events, wind]))


def mixed(seed: int) -> Case:
    """Trolley, bridge, hoist and gust at once."""

    def at_once(timeline: Timeline) -> None:
        start_s, period_s = timeline.end_s, timeline.period_s
        first = draw.drive(timeline)
        if timeline.rng.random() < 0.6:
            timeline.end_s = start_s + timeline.uniform(0, 0.8) * first.ramp_s
            draw.drive(timeline)
        end_s = max(event.end_s for event in timeline.events)
        draw.hoist(timeline, start_s + timeline.uniform(0, 0.8) * period_s)
        timeline.end_s = start_s + timeline.uniform(0, 0.8) * period_s
        draw.gust(timeline)
        timeline.end_s = max(end_s, *(event.end_s for event in timeline.events))

    return _case("mixed", seed, parts=((at_once,), (1.0,)))


KINDS: dict[str, Callable[[int], Case]] = {
    kind.__name__: kind
    for kind in (
        plain,
        hook,
        slew,
        luff,
        stepped_hoist,
        spin,
        string,
        mid_manoeuvre,
        faults,
        thermal,
        wide,
        steady_wind,
        mixed,
    )
}


def case_seeds(seed: int, count: int) -> list[int]:
    """Return the seeds of the single cases of a set."""
    return [int(one.generate_state(1)[0]) for one in np.random.SeedSequence(seed).spawn(count)]


def _more(seed: int) -> np.random.Generator:
    """Return the generator for what a kind adds to a plain case."""
    return np.random.default_rng([seed, 1])


def _case(
    kind: str,
    seed: int,
    parts: tuple[tuple[draw.Part, ...], tuple[float, ...]] = (draw.ORDINARY, draw.ORDINARY_SHARES),
) -> Case:
    rng = np.random.default_rng(seed)
    length_m = float(rng.uniform(5, 25))
    rho = float(rng.choice(RHOS, p=RHO_SHARES))
    crane = Crane(length_m, (1 - rho) * length_m, float(rng.uniform(0.001, 0.008)))
    offset, scale = rng.normal(0, 3e-4, size=3).tolist(), (1 + rng.normal(0, 3e-4, size=3)).tolist()
    sensor = SensorErrors(float(rng.choice(NOISES_G)), tuple(offset), tuple(scale))
    tilt, azimuth = np.radians(rng.uniform(0.2, 1.75)), rng.uniform(0, 2 * np.pi)
    believed_m = length_m * (1 + float(rng.normal(0, 0.05)))
    wind = rng.normal(0, 0.0175, size=2).tolist()
    timeline = draw.new_timeline(rng, length_m, crane.above_load_m)
    events: tuple[Event, ...] = draw.fill(timeline, *parts)
    return Case(
        kind=kind,
        seed=seed,
        rho=rho,
        crane=crane,
        events=events,
        sensor=sensor,
        believed_length_m=believed_m,
        tilt_rad=(float(tilt * np.cos(azimuth)), float(tilt * np.sin(azimuth))),
        steady_wind_m_s2=(wind[0], wind[1]),
    )
