"""The sentences of an incident's summary, from single messages."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gateway.incident.cause import MotionAroundPeak
from gateway.incident.course import CUT_OFF, Course
from gateway.incident.facts import incident_facts
from gateway.incident.incident_selection import AlertIncident, find_incidents
from gateway.incident.incident_summary import summary_sentences, suspension_texts, where_it_stood
from gateway.incident.timeline_figure import ReportClock
from gateway.messages import Alert, Motion, MotionState
from gateway.motion.history import MotionHistory
from gateway.motion.hypotheses import IS_DRIVEN, IS_GUST
from tests.gateway.incident.stated import HEAD, ORIGIN_NS, active, alert, built, calibration, health
from tests.gateway.incident.test_course import block


def test_a_recalibration_during_an_alert_is_told_in_words() -> None:
    course = built(
        (0.0, calibration()),
        (1.0, calibration(id="s1", phase="collecting", by="Ann", suspended=True)),
        (5.5, calibration(id="s1", phase="review", by="Ann", suspended=True)),
        (9.0, calibration(id="s1", phase="committed", by="Ann")),
    ).course(ORIGIN_NS, ORIGIN_NS + 12_000_000_000)
    (text,) = suspension_texts(course, ReportClock(course))
    assert text.startswith("From ")
    assert " or b" not in text
    assert text.endswith("because the sensor was recalibrated by Ann: how the load swung then is not known.")
    assert [(begin_s, end_s) for begin_s, end_s, by in course.suspended.spans(12.0) if by] == [(1.0, 9.0)]


def test_who_made_a_calibration_that_was_put_in_force_is_told() -> None:
    stated = (0.0, calibration()), (5.0, replace(calibration(0.6), record={"id": "c-2", "by": "Sven Otte"}))
    course = built(*stated).course(ORIGIN_NS, ORIGIN_NS + 9_000_000_000)
    sentences = summary_sentences(course, None, incident_facts(course, None))
    assert any(each.endswith(": calibrated, made by Sven Otte.") for each in sentences)


def test_a_recalibration_that_reaches_beyond_a_report_has_no_begin_and_no_end() -> None:
    course = built(
        (0.0, calibration(id="s1", phase="collecting", by="Ann", suspended=True)),
        (5.5, calibration(id="s1", phase="review", by="Ann", suspended=True)),
    ).course(ORIGIN_NS, ORIGIN_NS + 12_000_000_000)
    (text,) = suspension_texts(course, ReportClock(course))
    assert " or before to the end of this report or beyond it alerts were suspended" in text


@pytest.mark.parametrize(
    ("unknown", "expected"), [(5, "The largest angle between"), (30, "The largest known angle between")]
)
def test_an_angle_that_was_not_known_for_a_part_may_have_been_larger(unknown: int, expected: str) -> None:
    """Ten messages a second; up to a second without an angle is no loss of sight, as for an alert."""
    angles_deg = [6.0] * 40 + [None] * unknown + [5.0] * 20
    motions = [Motion(**HEAD, state="free", angle_deg=each, u_deg=0.1, reasons=[], text="") for each in angles_deg]
    builder = built(*((0.1 * number, motion) for number, motion in enumerate(motions)))
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 9_000_000_000)
    sentences = summary_sentences(course, None, incident_facts(course, None))
    (told,) = (each for each in sentences if each.startswith("The largest"))
    assert told.startswith(expected)
    assert told.endswith("for 3.0 s of this time it was not known.") == (unknown == 30)


@pytest.mark.parametrize(
    ("unknown_s", "said"),
    [
        ((5.0, 18.0), "No angle was known from 00:00:04.9 to 00:00:18.0 UTC: when it fell below 3.0° is not known."),
        ((5.0, 20.1), "No angle was known from 00:00:04.9 to 00:00:20.0 UTC: when it fell below 3.0° is not known."),
        ((5.0, 15.0), ""),
        ((18.0, 18.5), ""),
    ],
)
def test_an_alarm_that_cleared_behind_a_time_without_an_angle_is_told_so(
    unknown_s: tuple[float, float], said: str
) -> None:
    """It clears at 20 s, after 3 s below the level; up to a second without an angle is no loss of sight."""
    trip = active("swing", "trip", "b-1")
    stated: list[tuple[float, object]] = [(1.0, alert("raised", "swing", trip, incident="b-1"))]
    for number in range(220):
        is_unknown = unknown_s[0] <= 0.1 * number < unknown_s[1]
        angle_deg = None if is_unknown else 7.0 if number < 100 else 1.0
        stated.append((0.1 * number, Motion(**HEAD, state="free", angle_deg=angle_deg, u_deg=0.1, reasons=[], text="")))
    stated.append((20.0, alert("cleared", "swing", incident="b-1")))
    alerts = [(ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated if isinstance(each, Alert)]
    (found,) = find_incidents(alerts)
    course = built(*stated).course(ORIGIN_NS, ORIGIN_NS + 22_000_000_000)
    sentences = summary_sentences(course, found, incident_facts(course, found))
    assert [each for each in sentences if "when it fell below" in each] == ([said] if said else [])


def test_who_acknowledged_a_warning_has_not_acknowledged_the_trip_that_followed() -> None:
    warning, trip = active("swing", "warn", "b-1"), active("swing", "trip", "b-1")
    known = replace(alert("acknowledged", "swing", warning, incident="b-1"), acknowledged_by="bob")
    stated = [
        (1.0, alert("raised", "swing", warning, incident="b-1")),
        (2.0, known),
        (4.0, alert("raised", "swing", trip, incident="b-1")),
        (9.0, alert("cleared", "swing", incident="b-1")),
    ]
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated)
    course = built(*stated).course(ORIGIN_NS, ORIGIN_NS + 12_000_000_000)
    told = [each for each in summary_sentences(course, found, incident_facts(course, found)) if "acknowledge" in each]
    assert told == [
        "It was acknowledged at 2026-01-01 00:00:02.0 UTC by bob, while it stood at warning.",
        "The recordings state no acknowledgement of the trip of 00:00:04.0 UTC that followed, up to 2026-01-01 00:00:12.0 UTC, "
        "as far as they were read and checked.",
    ]


def test_the_end_of_an_alert_is_not_known_where_the_recordings_end_before_it() -> None:
    trip = active("swing", "trip", "b-1")
    stated = [(1.0, alert("raised", "swing", trip, incident="b-1")), (4.0, alert("standing", None, trip))]
    motions = [
        (0.1 * n, Motion(**HEAD, state="free", angle_deg=5.0, u_deg=0.1, reasons=[], text="")) for n in range(45)
    ]
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated)
    course = built(*motions, *stated).course(ORIGIN_NS, ORIGIN_NS + 4_400_000_000)
    facts = incident_facts(course, found)
    (told,) = (each for each in summary_sentences(course, found, facts) if each.startswith("The largest"))
    assert "The largest known angle between rope and vertical was 5.00°" in told
    assert told.endswith(": what came after 00:00:04.4 is not known.")
    assert facts.angle.missing == ("end",)


Stated = tuple[float, Alert]
WARNING, TRIP = active("swing", "warn", "b-1"), active("swing", "trip", "b-1")
TWO_TRIPS: list[Stated] = [
    (1.0, alert("raised", "swing", WARNING, incident="b-1")),
    (2.0, alert("raised", "swing", TRIP, incident="b-1")),
    (4.0, alert("changed", "swing", WARNING, incident="b-1")),
    (8.0, alert("raised", "swing", TRIP, incident="b-1")),
    (14.0, alert("cleared", "swing", incident="b-1")),
]
"""Definition: a trip at 2.0 s whose limit of 6.0° the angle may reach, and one at 8.0 s."""


def motion(angle_deg: float | None, u_deg: float = 0.1, state: MotionState = "free") -> Motion:
    return Motion(**HEAD, state=state, angle_deg=angle_deg, u_deg=u_deg, reasons=[], text="")


def told(stated: Sequence[Stated], angles: Sequence[Motion], end_s: float = 20.0) -> list[str]:
    """Return the sentences of an incident with ten motions a second from 0 s on."""
    course, found = course_of(stated, angles, end_s)
    return list(summary_sentences(course, found, incident_facts(course, found)))


def course_of(stated: Sequence[Stated], angles: Sequence[Motion], end_s: float) -> tuple[Course, AlertIncident]:
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated)
    motions = ((0.1 * number, each) for number, each in enumerate(angles))
    return built(*motions, *stated).course(ORIGIN_NS, ORIGIN_NS + round(end_s * 1e9)), found


@pytest.mark.parametrize(
    ("first_deg", "first_u_deg", "answer"),
    [
        (5.0, 0.1, "it did not reach the limit of 6.0°: the alert came from an upper bound that was not reached."),
        (5.0, 0.6, "it may have reached the limit of 6.0°: the interval of 95 % reaches up to 6.18°."),
        (
            6.1,
            0.1,
            "it may have reached the limit of 6.0° when the trip was raised: the best estimate did, and the interval of 95 % "
            "reaches down to 5.90°.",
        ),
        (6.5, 0.1, "it reached the limit of 6.0° when the trip was raised."),
    ],
)
def test_each_trip_has_its_own_answer_and_its_own_lead(first_deg: float, first_u_deg: float, answer: str) -> None:
    angles = [motion(1.0)] * 20 + [motion(first_deg, first_u_deg)] * 20 + [motion(1.0)] * 53 + [motion(7.0)] * 60
    sentences = told(TWO_TRIPS, angles)
    assert f"After the trip of 00:00:02.0 UTC {answer}" in sentences
    assert "After the trip of 00:00:08.0 UTC it reached the limit of 6.0° 1.3 s after the trip." in sentences
    assert "It was raised to trip again at 00:00:08.0 UTC." in sentences


ONE_TRIP = [TWO_TRIPS[0], TWO_TRIPS[1], (9.0, TWO_TRIPS[-1][1])]


@pytest.mark.parametrize(
    ("angles", "answer"),
    [
        (
            [motion(2.0)] * 40 + [motion(None)] * 20 + [motion(2.0)] * 40,
            "The known angle did not reach the limit of 6.0°; whether the load did is not known: for 2.0 s of the incident it "
            "was not known.",
        ),
        ([motion(2.0)] * 40 + [motion(None)] * 5 + [motion(2.0)] * 55, "It did not reach the limit of 6.0°: "),
        ([motion(2.0)] * 40 + [motion(2.0, 3.0)] + [motion(5.0)] * 59, "It may have reached the limit of 6.0°: "),
    ],
)
def test_what_is_not_known_is_not_said_to_have_stayed_below_the_limit(angles: list[Motion], answer: str) -> None:
    assert any(each.startswith(answer) for each in told(ONE_TRIP, angles))


def test_what_is_outside_the_time_of_a_report_is_neither_known_nor_timed() -> None:
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in ONE_TRIP)
    motions = ((0.1 * number, motion(7.0)) for number in range(40, 70))
    course = built(*motions, *ONE_TRIP).course(ORIGIN_NS + 4 * 10**9, ORIGIN_NS + 7 * 10**9)
    sentences = summary_sentences(course, found, incident_facts(course, found))
    assert "It reached the limit of 6.0°; when first is not in this report." in sentences
    assert any(each.endswith(": a part of the incident is outside the time of this report.") for each in sentences)


def test_a_time_without_samples_is_not_said_to_have_stayed_below_the_limit() -> None:
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in ONE_TRIP)
    builder = built(*((0.1 * number, motion(2.0)) for number in (*range(35), *range(60, 100))), *ONE_TRIP)
    for sequence, first_s in enumerate((0, 1, 2, 3, 6, 7, 8, 9)):
        builder.add_block(replace(block(first_s), sequence=sequence))
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 10 * 10**9)
    facts = incident_facts(course, found)
    assert facts.angle.unknown_s == pytest.approx(2.1)
    assert facts.answer == "may_have_been"


def test_the_interval_of_the_largest_angle_reaches_to_each_upper_end() -> None:
    angles = [motion(2.0)] * 40 + [motion(2.0, 1.5)] * 2 + [motion(4.0)] * 50
    assert any(
        each.startswith("The largest angle between rope and vertical was 4.0° (3.8° to 4.9° at 95 %)")
        for each in told(ONE_TRIP, angles)
    )


def test_the_largest_angle_is_taken_up_to_the_last_message_of_a_run_that_was_cut_off() -> None:
    """The alert is stated last at 4.0 s, and the run recorded until 4.8 s; the next one begins at 10 s."""
    stated = [*ONE_TRIP[:2], (4.0, alert("standing", None, TRIP))]
    angles = [motion(2.0)] * 41 + [motion(5.0 + 0.1 * number) for number in range(7)]
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated)
    builder = built(*((0.1 * number, each) for number, each in enumerate(angles)), *stated)
    for time_s, boot in ((0.0, "b001"), (4.8, "b001"), (10.0, "b002"), (12.0, "b002")):
        builder.add_run(ORIGIN_NS + round(time_s * 1e9), boot, "[recorder]\nfsync_s = 2.5\n")
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 12 * 10**9)
    text = " ".join(summary_sentences(course, found, incident_facts(course, found)))
    assert "The largest known angle between rope and vertical was 5.60° (5.40° to 5.80° at 95 %)" in text
    assert "what came after 00:00:04.8 is not known" in text
    assert "it stood at 2026-01-01 00:00:04.0 UTC, after which the gateway stopped without notice" in text
    assert (
        "(recorded up to 2026-01-01 00:00:04.8 UTC; it may have run up to 2.5 s longer, or more where somebody has cut its file)"
        in text
    )


def test_an_alarm_that_is_suspended_is_not_said_to_stand() -> None:
    unknown = active("swing", "unknown", "b-1")
    stated = [
        *ONE_TRIP[:2],
        (3.0, alert("changed", "swing", unknown, incident="b-1")),
        (9.0, alert("standing", None, unknown)),
    ]
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in stated)
    builder = built(*((0.1 * number, motion(7.0 if number < 30 else None)) for number in range(100)), *stated)
    course = builder.course(ORIGIN_NS, ORIGIN_NS + 10 * 10**9)
    text = " ".join(summary_sentences(course, found, incident_facts(course, found)))
    known_until = "its level was not known from 2026-01-01 00:00:03.0 UTC to 2026-01-01 00:00:09.0 UTC"
    assert f"The recordings state no end of it: {known_until}, after which they end." in text
    assert "stood at" not in text
    assert where_it_stood(replace(course, end_cause=CUT_OFF), found) == (
        "has no end, and no known level, where the recordings end"
    )


WIND = IS_GUST & ~IS_DRIVEN


def smoothed_gust(_: Path, begin_ns: int, end_ns: int) -> MotionAroundPeak:
    """Return a motion that is free but for a gust from 4 s to 6 s."""
    time_s = np.arange(begin_ns - ORIGIN_NS, end_ns - ORIGIN_NS, 10**8) / 1e9
    is_gust = (time_s >= 4.0) & (time_s < 6.0)
    nothing, known = np.full(len(time_s), np.nan), np.ones(len(time_s))
    history = MotionHistory(
        time_s=time_s,
        angle_rad=known,
        u_rad=known,
        azimuth_rad=known,
        rate_rad_s=known,
        pivot_acceleration_m_s2=np.full((len(time_s), 2), np.nan),
        pivot_acceleration_u_m_s2=nothing,
        hoist_m_s=nothing,
        hoist_u_m_s=nothing,
        length_m=known,
        length_u_m=known,
        probabilities=np.where(is_gust[:, None], WIND / WIND.sum(), ~WIND / (~WIND).sum()) * 1.0,
        state=tuple("wind" if gust else "free" for gust in is_gust),
    )
    return MotionAroundPeak(ORIGIN_NS, history, None)


LIVE: list[Motion] = (
    [motion(1.0)] * 40 + [motion(2.0, state="driven")] * 10 + [motion(2.0, state="wind")] * 10 + [motion(4.0)] * 30
)
"""Definition: the live estimate takes the gust from 4 s on for a drive, until 5 s."""


def test_the_smoothed_motion_says_what_moved_the_load() -> None:
    course, found = course_of(ONE_TRIP, LIVE, 12.0)
    facts = incident_facts(course, found, Path("cut.mcap"), smoothed_gust)
    text = " ".join(summary_sentences(course, found, facts))
    (move,) = facts.causes.moves
    assert move.state == "wind"
    assert (move.begin_s, move.end_s) == pytest.approx((4.0, 6.0))
    assert move.probability is not None
    assert move.probability > 0.9
    assert "trolley" not in text
    assert "live estimate" not in text


@pytest.mark.parametrize(("gap_s", "begin_s"), [(0.4, 0.0), (2.0, 4.0)])
def test_the_motion_is_smoothed_over_short_gaps_and_from_the_end_of_a_long_one_on(gap_s: float, begin_s: float) -> None:
    builder = built(*((0.1 * number, motion(7.0 if number == 80 else 2.0)) for number in range(100)), *ONE_TRIP)
    for sequence, first_s in enumerate((0.0, 1.0, 4.0 - gap_s - 0.9, *range(4, 10))):
        builder.add_block(replace(block(first_s), sequence=sequence))
    course, begins_ns = builder.course(ORIGIN_NS, ORIGIN_NS + 10 * 10**9), list[int]()
    (found,) = find_incidents((ORIGIN_NS + round(time_s * 1e9), each) for time_s, each in ONE_TRIP)

    def smooth(recording: Path, begin_ns: int, end_ns: int) -> MotionAroundPeak:
        begins_ns.append(begin_ns)
        return smoothed_gust(recording, begin_ns, end_ns)

    incident_facts(course, found, Path("cut.mcap"), smooth)
    assert begins_ns == [ORIGIN_NS + round(begin_s * 1e9)]


@pytest.mark.parametrize(
    ("doubt", "said"),
    [(None, "the motion was not smoothed"), ("a long drive", "the smoothed motion is unreliable: a long drive")],
)
def test_the_live_estimate_is_called_so_and_blames_no_drive_for_what_it_called_a_gust(
    doubt: str | None, said: str
) -> None:
    course, found = course_of(ONE_TRIP, LIVE, 12.0)

    def doubted(recording: Path, begin_ns: int, end_ns: int) -> MotionAroundPeak:
        return replace(smoothed_gust(recording, begin_ns, end_ns), doubt=doubt)

    facts = incident_facts(course, found, Path("cut.mcap"), None if doubt is None else doubted)
    sentences = list(summary_sentences(course, found, facts))
    (blamed,) = (each for each in sentences if "trolley" in each)
    assert blamed.startswith("Before the peak, by the gateway's live estimate a gust pushed the load, or trolley")
    assert any(each.endswith(f"{said}.") for each in sentences)


def test_samples_of_the_housing_in_a_hand_are_no_force_of_the_load() -> None:
    course = built(
        (0.0, calibration()),
        (1.0, calibration(id="s1", phase="collecting", by="Ann", suspended=True)),
        (5.5, calibration(id="s1", phase="committed", by="Ann")),
    ).course(ORIGIN_NS, ORIGIN_NS + 12_000_000_000)
    assert [(gap.begin_s, gap.end_s, gap.cause) for gap in course.hidden] == [(1.0, 5.5, "recalibrated by Ann")]


def acknowledged_at(time_s: float, incident: str) -> tuple[int, Alert]:
    stated = replace(alert("acknowledged", "swing", incident=incident), acknowledged_by="ann")
    return ORIGIN_NS + round(time_s * 1e9), stated


def test_an_acknowledgement_of_an_incident_of_a_run_that_is_not_there_is_told_alone() -> None:
    (found,) = find_incidents([acknowledged_at(5.0, "former-1")])
    course = built((0.0, health())).course(ORIGIN_NS, ORIGIN_NS + 9_000_000_000)
    (said,) = summary_sentences(course, found, incident_facts(course, found))
    assert said == (
        "Of incident former-1 only an acknowledgement is in these files (2026-01-01 00:00:05.0 UTC, ann); the alert itself is "
        "in a run that is not. Its level, times and angle are not known."
    )


@pytest.mark.parametrize("is_cleared", [False, True])
def test_an_acknowledgement_comes_after_the_end_only_where_that_is_known(*, is_cleared: bool) -> None:
    told = [
        (ORIGIN_NS, alert("raised", "swing", active("swing", "trip", "b-1"), incident="b-1")),
        (ORIGIN_NS + 2_000_000_000, alert("standing", None, active("swing", "trip", "b-1"))),
        *([(ORIGIN_NS + 2_500_000_000, alert("cleared", "swing", incident="b-1"))] if is_cleared else []),
        acknowledged_at(8.0, "b-1"),
    ]
    (found,) = find_incidents(told)
    course = built((0.0, health())).course(ORIGIN_NS, ORIGIN_NS + 9_000_000_000)
    said = " ".join(summary_sentences(course, found, incident_facts(course, found)))
    when = "after its end" if is_cleared else "after it was last stated at 2026-01-01 00:00:02.0 UTC"
    assert f"It was acknowledged at 2026-01-01 00:00:08.0 UTC by ann, {when}." in said
