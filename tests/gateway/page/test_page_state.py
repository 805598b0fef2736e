"""What the page process keeps: latest messages, ages, history, last good value."""

import math
from dataclasses import replace

import pytest
from pydantic_core import from_json, to_json

from gateway.messages import Calibration, Tilt
from gateway.page.channel import Frame, Parameters
from gateway.page.history import MAX_HISTORY_POINTS, SPAN_S, History
from gateway.page.state import PageState
from gateway.topics import TOPIC_OF, encode
from tests.gateway.calibration.test_turn_alignment import turning
from tests.gateway.scene import Scene

KEY = "plumbline/v1/north-yard/crane-3/hook"
MS_NS = 1_000_000


@pytest.fixture
def state() -> PageState:
    return PageState(Parameters(key=KEY, warn_deg=4.0, trip_deg=6.0))


def tell(state: PageState, scene: Scene, at_s: float, sequence: int = 0, time_ns: int | None = None) -> None:
    messages = scene.messages(sequence, round(at_s * 1000) * MS_NS if time_ns is None else time_ns)
    state.receive(Frame(TOPIC_OF[type(message)].name, at_s, encode(message)) for message in messages)


def test_the_snapshot_contains_messages_ages_and_verdict(state: PageState, scene: Scene) -> None:
    assert state.snapshot(9.0)["verdict"]["word"] == "NO DATA"
    tell(state, scene, 10.0)
    snapshot = from_json(to_json(state.snapshot(10.25)))
    assert snapshot["gateway"] is True
    assert snapshot["verdict"]["word"] == "OK"
    assert snapshot["topics"]["swing"]["phi_max_deg"] == 2.3
    assert set(snapshot["age_s"].values()) == {0.25}
    assert set(snapshot["topics"]) == {"tilt", "motion", "swing", "condition", "alert", "calibration", "health"}
    assert snapshot["page"]["crane"] == "crane-3"


def test_the_pushed_state_leaves_the_calibration_record_out(state: PageState, scene: Scene) -> None:
    tell(state, scene, 10.0)
    assert state.snapshot(10.0)["topics"]["calibration"].record["id"] == "six-2025-03"
    assert state.summary(10.0)["topics"]["calibration"].record == {}
    assert state.summary(10.0)["topics"]["calibration"].status == "calibrated"


def test_a_repeated_message_becomes_stale(state: PageState, scene: Scene) -> None:
    for k in range(30):
        tell(state, scene, 10.0 + k / 10, sequence=k, time_ns=77)
    assert state.evidence(12.9).age_s["tilt"] == pytest.approx(2.9)
    assert state.verdict(12.9).word == "STALE"


def test_a_gateway_that_hangs_is_no_longer_there(state: PageState, scene: Scene) -> None:
    tell(state, scene, 10.0)
    assert state.snapshot(12.9)["gateway"] is True
    assert state.snapshot(13.1)["gateway"] is False
    assert state.verdict(13.1).word == "STALE"


def test_messages_that_waited_for_the_page_are_as_old_as_they_are(state: PageState, scene: Scene) -> None:
    """A page that starts anew gets the last message of each topic, however old it is."""
    tell(state, scene, 10.0)
    assert state.verdict(60.0).word == "STALE"
    assert state.evidence(60.0).age_s["swing"] == pytest.approx(50.0)


@pytest.mark.parametrize("payload", [b"", b"{}", b"\xff\xfe", b'{"time_ns": "x"}', b"[1, 2"])
def test_invalid_messages_are_counted_and_ignored(state: PageState, scene: Scene, payload: bytes) -> None:
    tell(state, scene, 10.0)
    state.receive([Frame("tilt", 10.1, payload)])
    assert state.invalid == 1
    assert state.snapshot(10.1)["topics"]["tilt"].axial_deg == pytest.approx(0.8)
    assert state.evidence(10.1).age_s["tilt"] == pytest.approx(0.1)


def test_unknown_fields_are_ignored(state: PageState, scene: Scene) -> None:
    payload = encode(scene.tilt())[:-1] + b', "novel": 1}'
    state.receive([Frame("tilt", 10.0, payload)])
    assert (state.invalid, state.received["tilt"]) == (0, 1)


def test_the_last_good_value_is_the_last_sound_one(state: PageState, scene: Scene) -> None:
    tell(state, scene, 10.0)
    scene.phi_max_deg, scene.trusted, scene.condition = 9.9, False, "disturbed"
    tell(state, scene, 10.5)
    assert state.snapshot(12.0)["last_good"] == {"age_s": 2.0, "phi_max_deg": 2.3}


def test_the_last_good_value_has_no_angle_without_a_swing(state: PageState, scene: Scene) -> None:
    scene.swinging, scene.coverage95_deg, scene.condition = False, [0.0, 0.2], "static"
    tell(state, scene, 10.0)
    assert state.snapshot(10.0)["last_good"] == {"age_s": 0.0, "phi_max_deg": None}


def test_history_marks_unsound_values_and_gaps(state: PageState, scene: Scene) -> None:
    tell(state, scene, 10.0)
    scene.calibration = "uncalibrated"
    tell(state, scene, 10.5)
    for now_s in (15.0, 15.1):
        state.tick(now_s)
    assert state.history.rows(since=0, now_s=16.0) == [
        [0, 6.0, 2.3, 2.1, 2.5, True],
        [1, 5.5, 2.3, 2.1, 2.5, False],
        [2, 1.0, None, None, None, False],
    ]


def test_history_takes_two_points_a_second_and_a_gap_where_the_angle_is_not_known(scene: Scene) -> None:
    history = History()
    for k in range(21):
        history.add(scene.motion(), sound=True, at_s=k / 10)
    assert [row[1] for row in history.rows(since=0, now_s=2.0)] == pytest.approx([2.0, 1.5, 1.0, 0.5, 0.0])
    scene.coverage95_deg = None
    history.add(scene.motion(), sound=True, at_s=2.1)
    assert history.rows(since=5, now_s=2.1) == [[5, 0.0, None, None, None, False]]


def test_history_is_bounded_by_time_and_number(scene: Scene) -> None:
    history = History()
    for k in range(MAX_HISTORY_POINTS + 10):  # without the gaps it would take longer than the span
        history.add(scene.motion(), sound=True, at_s=k / 10)
        history.add_gap(at_s=k / 10)
    assert len(history.rows(since=0, now_s=0.0)) == MAX_HISTORY_POINTS
    assert [row[0] for row in history.rows(since=2 * MAX_HISTORY_POINTS + 18, now_s=0.0)] == [
        2 * MAX_HISTORY_POINTS + 18,
        2 * MAX_HISTORY_POINTS + 19,
    ]
    history.add(scene.motion(), sound=True, at_s=MAX_HISTORY_POINTS / 10 + SPAN_S - 1.0)
    kept = history.rows(since=0, now_s=MAX_HISTORY_POINTS / 10 + SPAN_S - 1.0)
    assert kept[0][1] == pytest.approx(SPAN_S)
    assert len(kept) == 41


def test_a_sensor_that_turns_on_a_shaft_shows_its_last_turn(state: PageState, scene: Scene) -> None:
    tell(state, scene, 10.0)
    assert state.snapshot(10.0)["align_turn"] is None
    gain = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    for message in scene.messages(1, 10_100 * MS_NS):
        if isinstance(message, Calibration):
            state.receive([Frame("calibration", 10.1, encode(replace(message, in_force={"gain_g_per_unit": gain})))])
    for number, (x, y, z) in enumerate(turning(0, (0, 0, 0.8), offset_g=(0.0, 0.0, 0.0)).tolist()):
        at_s = 11.0 + number / 10
        tilt = Tilt(
            time_ns=round(at_s * 1e9), clock="synchronised", sequence=number, calibration_id=None,
            axial_deg=math.degrees(math.acos(max(-1.0, min(1.0, z)))), specific_force_g=[x, y, z], delay_s=0.2,
            trusted=False,
        )  # fmt: skip
        state.receive([Frame("tilt", at_s, encode(tilt))])
    shown = from_json(to_json(state.snapshot(at_s)))["align_turn"]
    assert shown["n_turns"] == 1
    assert shown["advice"]["screw_axis"] == "y"
    assert "turn screw 5 (about y)" in shown["text"]
    assert shown["errors"].startswith("APE 0.8")
