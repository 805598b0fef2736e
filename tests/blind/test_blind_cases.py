"""Cases from a seed: the plan, the sensor chain, what is written, and that every effect shows."""

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.blind.cases import Case, generate
from tests.blind.mechanics import Motion
from tests.blind.outside import OUTSIDE
from tests.blind.plan import ALIKE, CATALOGUE, Plan, plan_cases
from tests.blind.score import INSEPARABLE
from tests.blind.sensor import Lag, Recording, Sampling, Sensor, Temperature, record
from tests.blind.write import write_case

SHORT_S = {"log": 12.0, "held_out": 3.0}
EVENTS = ("wind_gust", "hoisting", "trolley_acceleration", "impact", "load_change", "offset_step")
"""They begin later than a short recording ends."""
NAMES = (
    "viscous_damping quadratic_drag coulomb_friction steady_wind wind_gust hoisting trolley_acceleration slewing "
    "double_pendulum housing_position rope_length rope_stretch housing_spin impact load_change load_inertia "
    "pivot_compliance rope_mass pivot_friction axis_offset scale_error cross_axis mount_misalignment thermal_drift lowpass_lag "
    "clipping quantization clock_drift sample_loss vibration lever_arm housing_rocking housing_torsion sample_hold"
)
G = 9.80665
STILL = Temperature(start_c=22.0, rise_c=0.0, constant_s=60.0)


def test_plan_has_every_effect_of_the_vocabulary_and_the_promised_nulls() -> None:
    plans = plan_cases(300, seed=1)
    assert set(CATALOGUE) == set(NAMES.split())
    assert [plan.index for plan in plans] == list(range(300))
    nulls = [plan for plan in plans if plan.kind == "null"]
    assert len(nulls) == 100
    assert sum(plan.coloured for plan in nulls) >= 50
    assert sum(plan.jittered for plan in nulls) >= 50
    singles = [plan.hidden[0] for plan in plans if plan.kind == "single"]
    assert {singles.count(name) for name in CATALOGUE} <= {3, 4, 5}
    assert {plan.hidden[0] for plan in plans if plan.kind == "outside"} == set(OUTSIDE)
    assert not OUTSIDE.keys() & CATALOGUE.keys()


def test_pairs_are_separable() -> None:
    pairs = [set(plan.hidden) for plan in plan_cases(300, seed=1) if plan.kind == "pair"]
    assert len(pairs) == 40
    assert not [pair for pair in pairs for group in (*ALIKE, *INSEPARABLE) if pair <= group]


def test_same_seed_same_plan_other_seed_another() -> None:
    assert plan_cases(40, seed=7) == plan_cases(40, seed=7)
    assert plan_cases(40, seed=7) != plan_cases(40, seed=8)


@pytest.mark.slow
def test_same_plan_same_files(tmp_path: Path) -> None:
    plan = Plan(index=0, seed=11, kind="single", hidden=("vibration",), coloured=True, jittered=True)
    for name in ("first", "second"):
        write_case(generate(plan, SHORT_S), tmp_path / name)
    files = sorted(path.name for path in (tmp_path / "first").iterdir())
    assert files == ["held_out.csv", "log.csv", "rig.toml", "truth.json"]
    assert [(tmp_path / "first" / f).read_bytes() for f in files] == [
        (tmp_path / "second" / f).read_bytes() for f in files
    ]


def test_files_have_the_form_of_a_recording(tmp_path: Path) -> None:
    write_case(generate(Plan(index=0, seed=5, kind="null"), SHORT_S), tmp_path)
    rig = tomllib.loads((tmp_path / "rig.toml").read_text())
    assert rig["sensor"]["sample_rate_hz"] == 50
    assert 0 < rig["housing"]["position_m"] < rig["rope"]["length_m"]
    with (tmp_path / "log.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["time_s", "ax_g", "ay_g", "az_g", "temperature_c"]
    assert [float(row["time_s"]) for row in rows] == pytest.approx(np.arange(600) / 50)
    assert float(rows[0]["az_g"]) == pytest.approx(1.0, abs=0.1)
    assert json.loads((tmp_path / "truth.json").read_text())["effects"] == {}


def test_null_is_nothing_but_noise() -> None:
    case = generate(Plan(index=0, seed=3, kind="null"), SHORT_S)
    assert case.truth["excess"] == pytest.approx(0, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in (*CATALOGUE, *OUTSIDE) if name not in EVENTS])
def test_effect_shows(name: str) -> None:
    kind = "single" if name in CATALOGUE else "outside"
    case = generate(Plan(index=0, seed=2, kind=kind, hidden=(name,)), SHORT_S)
    assert case.truth["excess_alone"][name] >= 0.03
    assert name in case.truth["effects"]


@pytest.fixture(scope="module")
def null() -> Case:
    return generate(Plan(index=0, seed=2, kind="null"), {"log": 55.0})


@pytest.mark.slow
@pytest.mark.parametrize("name", EVENTS)
def test_event_begins_when_the_truth_says(null: Case, name: str) -> None:
    kind = "single" if name in CATALOGUE else "outside"
    case = generate(Plan(index=0, seed=2, kind=kind, hidden=(name,)), {"log": 55.0})
    apart = np.abs(case.recordings["log"].force_g - null.recordings["log"].force_g).max(axis=1)
    start_s = case.truth["effects"][name]["start_s"]
    first_s = case.recordings["log"].time_s[np.argmax(apart > 1e-6)]
    assert start_s - 0.6 < first_s < start_s + 0.6


def still_motion(seconds: float = 40.0, across_g: float = 0.0) -> Motion:
    time_s = np.arange(0, seconds + 1, 0.005)
    force = np.tile([across_g * G, 0.0, G], (len(time_s), 1))
    return Motion(time_s, force, np.zeros(len(time_s)))


def recorded(
    sensor: Sensor | None = None, sampling: Sampling | None = None, motion: Motion | None = None, count: int = 2000
) -> Recording:
    sampling = sampling or Sampling(rate_hz=50.0, noise_g=0.001)
    return record(motion or still_motion(), sensor or Sensor(), sampling, STILL, count, np.random.default_rng(4))


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_noise_has_the_stated_rms_and_memory(memory: float) -> None:
    sampling = Sampling(rate_hz=50.0, noise_g=0.001, noise_memory=memory)
    noise = recorded(sampling=sampling, motion=still_motion(400), count=20_000).force_g - [0, 0, 1]
    assert noise.std() == pytest.approx(0.001, rel=0.03)
    assert np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1] == pytest.approx(memory, abs=0.03)


def test_digits_come_after_the_noise_and_the_rail() -> None:
    sensor = Sensor(lsb_g=0.004, full_scale_g=1.0)
    reading = recorded(sensor).force_g
    np.testing.assert_allclose(reading / 0.004, np.round(reading / 0.004), atol=1e-9)
    assert reading.max() == 1.0


def test_lost_samples_leave_even_times() -> None:
    recording = recorded(Sensor(loss_fraction=0.05))
    assert 1850 < len(recording.time_s) < 1950
    np.testing.assert_allclose(np.diff(recording.time_s), 0.02)


def test_clock_that_runs_fast_states_more_seconds() -> None:
    assert recorded(Sensor(clock_relative=0.01)).time_s[-1] == pytest.approx(1999 / 50 * 1.01)


def test_jitter_moves_the_instants() -> None:
    sampling = Sampling(rate_hz=50.0, noise_g=0.001, jitter_s=0.002)
    times_s = recorded(sampling=sampling).time_s
    assert np.std(times_s - np.arange(2000) / 50) == pytest.approx(0.002, rel=0.1)


def test_lag_is_a_pole_at_its_cutoff() -> None:
    frequency_hz, cutoff_hz = 0.4, 0.8
    time_s = np.arange(0, 41, 0.005)
    force = np.zeros((len(time_s), 3))
    force[:, 0] = G * np.sin(2 * np.pi * frequency_hz * time_s)
    sampling = Sampling(rate_hz=50.0, noise_g=0.0)
    motion = Motion(time_s, force, np.zeros(len(time_s)))
    lagging = recorded(Sensor(lag=Lag(cutoff_hz, 1)), sampling, motion)
    response = 1 / (1 + 1j * frequency_hz / cutoff_hz)
    expected = np.imag(response * np.exp(2j * np.pi * frequency_hz * lagging.time_s))
    np.testing.assert_allclose(lagging.force_g[500:, 0], expected[500:], atol=2e-5)


def test_offset_scale_and_cross_axis_act_in_this_order() -> None:
    sensor = Sensor(axes=np.array([[1.1, 0.02, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.9]]), offset_g=(0.0, 0.01, 0.0))
    reading = recorded(sensor, Sampling(50.0, 0.0), still_motion(across_g=0.2)).force_g[0]
    assert reading == pytest.approx([0.22, 0.01, 0.9])
