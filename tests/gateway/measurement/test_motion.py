"""The measurement of a recording in which the crane works."""

import csv
import io
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from devices.pendulum.pendulum import start_motion
from devices.simulated.crane import Crane
from devices.simulated.schedule import Event, Hoist, TrolleyMove
from gateway.measurement.followed_recording import follow_recording
from gateway.measurement.measure import Measurement, measure
from gateway.measurement.motion import (
    RecordingMotion,
    find_doubt,
    motion_rows,
    motion_table,
    recording_motion,
    with_smoothed_angle,
)
from gateway.measurement.report import as_json, as_text
from gateway.measurement.source import Source
from gateway.measurement.swing import estimate_source_swing
from gateway.motion.history import MotionPhase
from gateway.swing.estimate import SwingEstimate
from gateway.swing.model.mount import rotation
from gateway.swing.rig import MountedHousing
from tests.gateway.measurement.simulated_source import source_of
from tests.values import present

HOUSING = MountedHousing(length_m=9.4, above_load_m=4.5, gravity_m_s2=9.80665)
LENGTH_M, RATE_HZ, NOISE_G, DURATION_S = 9.0, 50.0, 0.0004, 60.0
WORK = (
    TrolleyMove(start_s=15.0, duration_s=9.0, ramp_s=3.0, speed_m_s=1.0, azimuth_rad=0.4),
    Hoist(start_s=38.0, duration_s=8.0, by_m=-2.0),
)


def crane(events: tuple[Event, ...], swing_deg: float) -> Crane:
    motion = start_motion(math.radians(swing_deg), 0.0, 0.0, 0.0)
    return Crane(length_m=LENGTH_M, position_m=4.5, gravity_m_s2=9.80665, events=events, motion=motion)


def recorded(events: tuple[Event, ...], swing_deg: float = 2.0) -> tuple[Source, float]:
    """A recording and its largest true angle in degrees."""
    time_s = np.arange(0, DURATION_S, 1 / RATE_HZ)
    force_g = crane(events, swing_deg).specific_force_m_s2(time_s) / 9.80665
    force_g += np.random.default_rng(3).normal(0, NOISE_G, force_g.shape)
    source = source_of(time_s, force_g, HOUSING, NOISE_G)
    return source, float(np.degrees(crane(events, swing_deg).truth(time_s).rope_angle_rad.max()))


@pytest.fixture(scope="module")
def working() -> tuple[Source, float]:
    return recorded(WORK)


def smoothed_motion(source: Source, swing: SwingEstimate) -> RecordingMotion:
    smoothed = present(follow_recording(source, smooths=True).motion)
    return present(recording_motion(source, swing, smoothed))


@pytest.fixture(scope="module")
def measured(working: tuple[Source, float]) -> Measurement:
    return measure(working[0])


@pytest.mark.slow
def test_a_drive_leaves_the_largest_angle_with_an_interval(
    working: tuple[Source, float], measured: Measurement
) -> None:
    content: dict[str, Any] = json.loads(json.dumps(as_json(working[0], measured)))
    low_deg, high_deg = content["swing"]["coverage95_deg"]
    # 8 % of the distance to the load, to which the place counts as known, are 0.25 deg of a swing of 3.3 deg
    assert low_deg < working[1] < high_deg < low_deg + 0.6
    assert content["swing_reasons"][0] == "largest angle from the smoothed motion, because the crane worked"
    assert content["motion"]["largest"]["angle_deg"] == content["swing"]["phi_max_deg"]
    assert content["motion"]["known_percent"] == 100
    assert measured.swing.length_m == pytest.approx(LENGTH_M, abs=2 * present(measured.swing.length_u_m))
    assert present(measured.swing.length_u_m) < 0.3


@pytest.mark.slow
def test_a_place_from_the_pivot_is_taken_to_move_with_the_load_where_the_readings_say_so(
    working: tuple[Source, float], measured: Measurement
) -> None:
    """The hoist lifts load and housing by 2 m; a housing on a part of the rope that stays would have come nearer to the load."""
    stated = replace(HOUSING, above_load_m=None, position_m=HOUSING.length_m - 4.5)
    swing = measure(replace(working[0], housing=stated)).swing
    low_rad, high_rad = present(swing.coverage95_rad)
    assert math.degrees(low_rad) < working[1] < math.degrees(high_rad)
    assert high_rad - low_rad < 1.2 * np.subtract(*present(measured.swing.coverage95_rad)[::-1])


def test_the_phases_cover_the_recording_in_order(measured: Measurement) -> None:
    phases = present(measured.motion).phases
    assert [one.to_s for one in phases[:-1]] == [one.from_s for one in phases[1:]]
    driven = [one for one in phases if one.state == "driven"]
    hoisting = [one for one in phases if one.state == "hoisting"]
    assert driven[0].from_s == pytest.approx(15.0, abs=1.0)
    assert hoisting[0].from_s == pytest.approx(38.0, abs=1.5)
    assert hoisting[-1].to_s == pytest.approx(46.0, abs=1.5)
    assert all(one.largest is not None for one in phases)


@pytest.mark.slow
def test_the_largest_angle_is_where_the_rope_was_farthest(working: tuple[Source, float], measured: Measurement) -> None:
    truth = crane(WORK, 2.0).truth(working[0].recording.time_s)
    at = round(present(present(measured.motion).largest).time_s * RATE_HZ)
    assert truth.rope_angle_rad[at] > truth.rope_angle_rad.max() - math.radians(0.05)


@pytest.mark.slow
def test_the_motion_says_when_the_crane_moved(working: tuple[Source, float], measured: Measurement) -> None:
    """Wherever it did or did not for 0.8 s before and after: the beginning and the end of a ramp are gentle."""
    time_s, history = working[0].recording.time_s, present(measured.motion).history
    truth = crane(WORK, 2.0).truth(time_s)
    moved, judged = truth.trolley | truth.hoisting, 0
    for bin_s, state in zip(history.time_s, history.state, strict=True):
        around = moved[np.abs(time_s - bin_s) <= 0.8]
        if around.all() or not around.any():
            assert (state in {"driven", "hoisting"}) == around.all(), bin_s
            judged += 1
    assert judged > 0.8 * len(history.time_s)


def test_the_text_has_a_line_for_each_phase(working: tuple[Source, float], measured: Measurement) -> None:
    text = as_text(working[0], measured)
    assert "motion       largest angle" in text
    assert "s trolley or bridge moving, up to" in text
    assert "s hoisting, up to" in text


def test_the_table_has_a_row_for_each_bin(measured: Measurement) -> None:
    history = present(measured.motion).history
    rows = list(csv.DictReader(io.StringIO(motion_table(history))))
    bin_s = HOUSING.small_swing_period_s / 20  # long bins average what slings and strings do
    assert len(rows) == len(history.time_s) == pytest.approx(DURATION_S / bin_s, abs=2)
    middle = rows[len(rows) // 2]
    place = len(rows) // 2
    assert float(middle["angle_deg"]) == pytest.approx(math.degrees(history.angle_rad[place]), rel=1e-4)
    assert middle["state"] == history.state[place]


@pytest.mark.slow
def test_a_free_swing_has_no_timeline_unless_it_is_asked_for() -> None:
    source, largest_deg = recorded((), 5.0)
    free = measure(source)
    assert free.motion is None
    assert as_json(source, free)["motion"] is None
    asked = measure(source, with_motion=True)
    assert asked.swing == free.swing
    low_rad, high_rad = present(present(asked.motion).largest).coverage95_rad
    assert low_rad < math.radians(largest_deg) < high_rad


@pytest.mark.slow
def test_a_housing_at_an_unknown_place_has_no_motion(working: tuple[Source, float]) -> None:
    assert measure(replace(working[0], housing=None), with_motion=True).motion is None


@pytest.mark.slow
def test_readings_that_no_upright_housing_has_give_no_motion(working: tuple[Source, float]) -> None:
    source = working[0]
    assert measure(replace(source, force_g=source.force_g[:, [2, 1, 0]]), with_motion=True).motion is None


@pytest.mark.slow
def test_the_motion_is_doubted_with_the_rig_that_it_rests_on(working: tuple[Source, float]) -> None:
    source, _ = working
    swing = estimate_source_swing(source)
    motion = smoothed_motion(source, replace(swing, reasons=("rig and sensor as stated do not explain the data",)))

    rows = motion_rows(motion)
    assert rows[0][1].startswith("unreliable: largest angle")
    assert motion.doubt == "rig and sensor as stated do not explain the data"
    assert not any("95 %" in text for _, text in rows)
    assert any("95 %" in text for _, text in motion_rows(replace(motion, doubt=None)))


@pytest.mark.slow
@pytest.mark.parametrize(("above_load_m", "is_right"), [(4.5, True), (6.8, False), (2.5, False)])
def test_no_interval_where_the_force_along_the_rope_contradicts_the_place_of_the_housing(
    above_load_m: float, *, is_right: bool
) -> None:
    """A hasty start and a catch: the fit of a pendulum does not explain the whole, and the smoothed motion takes its place."""
    hasty = TrolleyMove(start_s=10.0, duration_s=20.0, ramp_s=2.0, speed_m_s=1.2, azimuth_rad=0.4)
    source, true_deg = recorded((hasty,), swing_deg=1.0)
    housing = replace(HOUSING, above_load_m=above_load_m, position_u_m=0.05)
    found = measure(replace(source, housing=housing), with_motion=True)
    motion = present(found.motion)
    assert (motion.doubt is None) == is_right
    coverage95_rad = found.swing.coverage95_rad
    if not is_right:
        assert coverage95_rad is None
        assert any("contradicts the force along the rope" in reason for reason in found.swing.reasons)
        assert as_json(source, found)["motion"]["largest"]["coverage95_deg"] is None
    else:
        low_deg, high_deg = np.degrees(present(coverage95_rad))
        assert low_deg < true_deg < high_deg


@pytest.mark.slow
@pytest.mark.parametrize("askew_deg", [1.0, 5.0])
def test_a_free_swing_near_the_pivot_with_a_housing_askew_has_no_drive_and_no_wind(askew_deg: float) -> None:
    position_m = 0.05 * LENGTH_M
    swinging = Crane(
        length_m=LENGTH_M,
        position_m=position_m,
        gravity_m_s2=9.80665,
        events=(),
        motion=start_motion(math.radians(11), 0.0, 0.0, math.radians(5)),
    )
    time_s = np.arange(0, 23.0, 1 / 25)
    turned = rotation(np.array([-math.radians(0.3), math.radians(askew_deg)]))
    force_g = swinging.specific_force_m_s2(time_s) / 9.80665 @ turned.T
    force_g += np.random.default_rng(3).normal(0, 3e-4, force_g.shape)
    housing = MountedHousing(length_m=LENGTH_M, position_m=position_m, mount_u_rad=None, gravity_m_s2=9.80665)

    found = measure(source_of(time_s, force_g, housing, 3e-4))

    assert found.swing.swinging
    assert (found.conditions.verdict, found.conditions.cause) == ("swinging", None)
    assert found.conditions.reasons[0] == "moves as a free pendulum"


@pytest.mark.slow
def test_a_drive_that_fills_a_recording_is_doubted(working: tuple[Source, float]) -> None:
    source, _ = working
    swing = estimate_source_swing(source)
    motion = smoothed_motion(source, swing)
    assert motion.doubt is None
    assert with_smoothed_angle(replace(swing, coverage95_rad=None), motion).coverage95_rad is not None
    ends_s = float(motion.history.time_s[0]), float(motion.history.time_s[-1])
    endless = MotionPhase(state="driven", from_s=ends_s[0], to_s=ends_s[1], largest=None)
    doubt = find_doubt(swing, [endless], ends_s[1] - ends_s[0], None)
    doubted = with_smoothed_angle(replace(swing, coverage95_rad=None), replace(motion, doubt=doubt))
    assert doubted.coverage95_rad is None
    assert doubted.reasons[0].startswith(
        "the smoothed motion is unreliable: it has trolley or bridge accelerate for 60 s"
    )
