"""Inputs of the crane that are estimated from a recording and known to its model.

The recordings are those of the simulated crane at work: its drives have other shapes than the profiles of the twin.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.pendulum import pendulum
from devices.pendulum.equations import Vector
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_rate_1_s
from devices.recording import Recording
from devices.simulated.crane import Crane
from devices.simulated.schedule import Event, Hoist, TrolleyMove
from gateway.measurement.source import Source
from gateway.motion.history import MotionHistory
from gateway.motion.hypotheses import IS_DRIVEN, IS_GUST, IS_HOISTING, N_HYPOTHESES
from gateway.recording.reading.interval import RecordingExtent
from gateway.twin.effects import EFFECTS
from gateway.twin.model import Model, TwinRig
from gateway.twin.reconcile.data.crane_inputs import (
    MARGIN_S,
    NO_INPUTS,
    CraneInputs,
    CraneMotion,
    MotionCorrection,
    SineSeries,
    estimate_inputs,
    find_inputs,
    registered,
)
from gateway.twin.reconcile.data.data_checks import check_recording
from gateway.twin.reconcile.data.observations import make_observations
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.output.serialisation import format_model_toml, to_json
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
LENGTH_M, POSITION_M, NOISE_G, RATE_HZ, DURATION_S = 10.0, 5.0, 4e-4, 25.0, 110.0
DRIVES = (
    TrolleyMove(start_s=20.0, duration_s=8.0, ramp_s=2.5, speed_m_s=0.8, azimuth_rad=0.4),
    TrolleyMove(start_s=80.0, duration_s=7.0, ramp_s=2.5, speed_m_s=0.6, azimuth_rad=2.0),
)
HOIST = Hoist(start_s=46.0, duration_s=6.0, by_m=-1.2)
WORK: tuple[Event, ...] = (DRIVES[0], HOIST, DRIVES[1])
RIG = TwinRig(LENGTH_M, POSITION_M, STANDARD_GRAVITY_M_S2, (NOISE_G,) * 3)


class DraggedCrane(Crane):
    """A crane whose load has a drag in proportion to the square of its speed, F/m = -k |v| v."""

    drag_per_m = 0.02

    def _rate(self, motion: list[Vector], acting: Vector, length: float, length_rate: float) -> list[Vector]:
        rate = np.array(motion[1])
        drag = self.drag_per_m * length**2 * float(np.linalg.norm(rate)) * rate
        x, y, z = (np.array(acting) - drag).tolist()
        return super()._rate(motion, (x, y, z), length, length_rate)

    def _with_damping(self, acting_m_s2: Array, n_rate: Array, length_m: Array) -> Array:
        drag = self.drag_per_m * length_m**2 * np.linalg.norm(n_rate, axis=1, keepdims=True) * n_rate
        return super()._with_damping(acting_m_s2 - drag, n_rate, length_m)


@dataclass(frozen=True, kw_only=True)
class Work:
    """A crane at work, and what differs from the rig."""

    events: tuple[Event, ...] = WORK
    crane: type[Crane] = Crane
    damping_ratio: float = 0.0
    offset_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift_g_k: tuple[float, float, float] = (0.0, 0.0, 0.0)
    position_m: float = POSITION_M
    """The true one; the rig says `POSITION_M`."""
    amplitude_deg: float = 4.0
    seed: int = 1


def record(work: Work) -> Recording:
    """Return a recording of 110 s, with noise."""
    rng = np.random.default_rng(work.seed)
    speed = small_swing_rate_1_s(LENGTH_M, STANDARD_GRAVITY_M_S2)
    first = math.radians(work.amplitude_deg) * np.exp(1j * rng.uniform(0, 2 * np.pi))
    side = 0.3j * speed * first
    crane = work.crane(
        length_m=LENGTH_M,
        position_m=work.position_m,
        events=work.events,
        motion=pendulum.start_motion(first.real, first.imag, side.real, side.imag),
        damping_ratio=work.damping_ratio,
    )
    time_s: Array = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    warming_c = 10 * -np.expm1(-time_s / 40)
    force_g = crane.specific_force_m_s2(time_s) / STANDARD_GRAVITY_M_S2
    force_g += np.array(work.offset_g) + np.outer(warming_c, work.drift_g_k) + NOISE_G * rng.normal(size=force_g.shape)
    none = np.zeros(len(time_s), dtype=np.int64)
    return Recording(
        time_s=time_s, raw=force_g, unit="g", lost_before=none, unusable_before=none, temperature_c=22 + warming_c
    )


def source_of(recording: Recording) -> Source:
    extent = RecordingExtent(float(recording.time_s[0]), float(recording.time_s[-1]), None)
    return Source((Path("work.csv"),), recording, extent, recording.raw, 0.01, "as recorded")


def ask(recording: Recording, held_out: Recording | None = None) -> Reconciliation:
    log, second = source_of(recording), None if held_out is None else source_of(held_out)
    return reconcile(
        Model(RIG, {}),
        check_recording(log, RIG),
        None if second is None else check_recording(second, RIG),
        inputs=estimate_inputs(log, RIG),
        held_out_inputs=NO_INPUTS if second is None else estimate_inputs(second, RIG, "held_out_"),
    )


def history(
    duration_s: float = 60.0,
    driven_s: tuple[tuple[float, float], ...] = (),
    hoisting_s: tuple[tuple[float, float], ...] = (),
    acceleration_m_s2: float = 0.3,
) -> MotionHistory:
    """A smoothed motion with drives along x and hoists of 0.2 m/s."""
    time_s = np.arange(0.0, duration_s, 0.1)

    def within(spans_s: tuple[tuple[float, float], ...]) -> NDArray[np.bool_]:
        found = np.zeros(len(time_s), dtype=bool)
        for from_s, to_s in spans_s:
            found |= (time_s >= from_s) & (time_s <= to_s)
        return found

    driven, hoisting = within(driven_s), within(hoisting_s)
    probabilities = np.zeros((len(time_s), N_HYPOTHESES))
    for place in np.flatnonzero(~IS_GUST):
        probabilities[(driven == IS_DRIVEN[place]) & (hoisting == IS_HOISTING[place]), place] = 0.5
    still = np.zeros(len(time_s))
    return MotionHistory(
        time_s=time_s,
        angle_rad=still,
        u_rad=still,
        azimuth_rad=still,
        rate_rad_s=still,
        pivot_acceleration_m_s2=np.stack([acceleration_m_s2 * driven, still], axis=1),
        pivot_acceleration_u_m_s2=still + 0.01,
        hoist_m_s=0.2 * hoisting.astype(np.float64),
        hoist_u_m_s=still + 0.01,
        length_m=still + LENGTH_M,
        length_u_m=still + 0.01,
        probabilities=probabilities,
        state=tuple("free" for _ in time_s),
    )


def motions(inputs: CraneInputs) -> list[CraneMotion]:
    return [effect for effect in inputs.effects if isinstance(effect, CraneMotion)]


@pytest.mark.slow
def test_a_profile_is_kept_with_its_slope_and_its_integral() -> None:
    time_s = np.linspace(0, 9, 91)
    series = SineSeries.of(time_s, np.sin(np.pi * time_s / 9) ** 3, 9.0)
    fine_s = np.linspace(0, 9, 9001)
    value, slope, integral = (
        np.array([float(part(each)) for each in fine_s]) for part in (series.value, series.slope, series.integral)
    )
    assert value[::100] == pytest.approx(np.sin(np.pi * time_s / 9) ** 3, abs=1e-6)
    assert np.gradient(value, fine_s)[1:-1] == pytest.approx(slope[1:-1], abs=1e-5)
    assert integral[-1] == pytest.approx(np.trapezoid(value, fine_s), abs=1e-6)


def test_drives_and_hoists_are_listed_with_their_peaks() -> None:
    found = find_inputs(history(driven_s=((10, 13), (30, 34)), hoisting_s=((45, 50),)), RIG).found
    assert [(each.kind, each.unit) for each in found] == [("drive", "m/s²"), ("drive", "m/s²"), ("hoist", "m/s")]
    assert [each.from_s for each in found] == pytest.approx([10, 30, 45])
    assert [each.peak for each in found] == pytest.approx([0.3, 0.3, 0.2])


def test_what_is_not_significant_is_no_input() -> None:
    assert find_inputs(history(driven_s=((10, 13),), acceleration_m_s2=0.02), RIG) == NO_INPUTS
    assert find_inputs(history(), RIG).values == {}


def test_inputs_close_to_each_other_are_one_motion() -> None:
    inputs = find_inputs(history(driven_s=((10, 13),), hoisting_s=((12, 16),)), RIG)
    (motion,) = motions(inputs)
    assert len(inputs.found) == 2
    assert motion.changes_length
    assert motion.duration_s == pytest.approx(6 + 2 * MARGIN_S)
    corrections = [effect for effect in inputs.effects if isinstance(effect, MotionCorrection)]
    assert len(corrections) == 2


def test_only_the_time_counts_in_which_the_crane_rests() -> None:
    inputs = find_inputs(history(driven_s=((10, 13),)), RIG)
    time_s = np.arange(0, 60, 0.05)
    swing = 0.05 * np.sin(time_s)[:, None] * [1.0, 0.5, 0.0] + [0, 0, 1]
    whole = make_observations(time_s, swing, None, np.full(3, NOISE_G))
    left = inputs.leave_out(whole)
    works = (time_s > 9.1) & (time_s < 13.9)
    rests = (time_s < 8.9) | (time_s > 14.1)
    assert not left.used[works].any()
    assert (left.used[rests] == whole.used[rests]).all()


def test_effects_of_inputs_are_registered_only_while_they_are_needed() -> None:
    inputs = find_inputs(history(driven_s=((10, 13),)), RIG)
    with registered(inputs):
        assert set(inputs.values) <= set(EFFECTS)
    assert not set(inputs.values) & set(EFFECTS)


def test_two_corrections_leave_the_load_with_any_motion() -> None:
    inputs = find_inputs(history(driven_s=((10, 13),)), RIG)
    time_s = np.arange(0, 40, 0.05)
    with registered(inputs):
        simulator = Simulator(RIG, tuple(inputs.values))
        jacobian = simulator.linearise(simulator.values([0.05, 0.0, 0.0, 0.03, 0.0], inputs.values), time_s).jacobian
        labels = [spec.label for spec in simulator.parameters]
    columns = [i for i, label in enumerate(labels) if "delta_v" in label]
    after = jacobian[time_s > 15][:, :2][:, :, columns].reshape(-1, 4)
    scaled = after / np.linalg.norm(after, axis=0)
    assert np.linalg.svd(scaled, compute_uv=False)[-1] > 0.3


@pytest.mark.slow
def test_a_crane_that_hardly_rests_gives_no_verdict() -> None:
    recording = record(Work())
    checked = check_recording(source_of(recording), RIG)
    inputs = find_inputs(history(110.0, driven_s=((3.0, 107.0),)), RIG)
    result = reconcile(Model(RIG, {}), checked, None, inputs=inputs)
    assert result.verdict == "data_unusable"
    assert "the crane works" in result.reason


@pytest.fixture(scope="module")
def damped() -> Reconciliation:
    """The answer for a crane with damping; its second recording has a drive alone."""
    return ask(record(Work(damping_ratio=0.004)), record(Work(damping_ratio=0.004, events=DRIVES[:1], seed=3)))


@pytest.mark.slow
def test_damping_is_named_beside_the_work_of_the_crane(damped: Reconciliation) -> None:
    assert (damped.verdict, [effect.name for effect in damped.effects]) == ("named", ["viscous_damping"])
    low, high = damped.effects[0].parameters["damping_ratio"].ci95
    assert float(np.asarray(low)) < 0.004 < float(np.asarray(high))


@pytest.mark.slow
def test_inputs_of_each_recording_are_in_the_result_and_not_in_the_model(damped: Reconciliation) -> None:
    every = to_json(damped, 1.0)["inputs"]
    assert {each["kind"] for each in every if each["recording"] == "held_out"} == {"drive"}
    inputs = [each for each in every if each["recording"] == "log"]
    assert {each["kind"] for each in inputs} == {"drive", "hoist"}
    (hoist,) = [each for each in inputs if each["kind"] == "hoist"]
    assert hoist["from_s"] == pytest.approx(HOIST.start_s, abs=1.0)
    assert hoist["to_s"] == pytest.approx(HOIST.start_s + HOIST.duration_s, abs=1.0)
    assert hoist["peak"] == pytest.approx(1.875 * HOIST.by_m / HOIST.duration_s, rel=0.1)
    drives = [each for each in inputs if each["kind"] == "drive"]
    assert drives[0]["from_s"] == pytest.approx(DRIVES[0].start_s, abs=1.0)
    assert drives[-1]["to_s"] == pytest.approx(DRIVES[-1].start_s + DRIVES[-1].duration_s, abs=1.0)
    assert "crane_motion" not in format_model_toml(damped)


@pytest.mark.slow
def test_a_crane_at_work_with_nothing_missing() -> None:
    assert ask(record(Work(seed=2))).verdict == "none_missing"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameter", "expected", "work"),
    [
        ("quadratic_drag", "drag_per_m", 0.02, Work(crane=DraggedCrane, amplitude_deg=7.0)),
        ("axis_offset", "offset_g", (0.002, -0.001, 0.0015), Work(offset_g=(0.002, -0.001, 0.0015))),
        ("housing_position", "error_m", -0.6, Work(position_m=POSITION_M - 0.6)),
        ("thermal_drift", "mg_per_c", (0.1, -0.05, 0.1), Work(drift_g_k=(1e-4, -5e-5, 1e-4))),
    ],
)
def test_the_work_of_the_crane_does_not_hide_an_effect(
    name: str, parameter: str, expected: float | tuple[float, ...], work: Work
) -> None:
    result = ask(record(work))
    assert (result.verdict, [effect.name for effect in result.effects]) == ("named", [name])
    low, high = (np.atleast_1d(end) for end in result.effects[0].parameters[parameter].ci95)
    assert (low < np.atleast_1d(expected)).all()
    assert (np.atleast_1d(expected) < high).all()
