"""The pipeline over the simulated crane, with the demonstration: what comes out is what happened."""

import logging
import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from devices.block import SampleBlock
from devices.pendulum.pendulum import start_motion
from devices.simulated.crane import Crane
from devices.simulated.device import SimulatedCrane
from gateway import messages
from gateway.calibration.correction import correction_for
from gateway.configuration.loading import validate
from gateway.daemon.sampling.device_factory import make_device
from gateway.messages import NO_SESSION, Alert
from gateway.packing import unpack
from gateway.pipeline.alert_rules import ALERT_RULES
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker, MessageTime, OutgoingMessage
from gateway.pipeline.pipeline import Pipeline
from tests.clocks import SleeplessClock
from tests.values import present

LENGTH_M, POSITION_M, RATE_HZ = 8.0, 5.0, 100.0
CLOCK = ClockState("synchronised", 3_600_000_000_000)


class Run:
    """A crane, its device and a pipeline."""

    def __init__(self, crane: Crane, table: dict[str, Any] | None = None, block_samples: int = 10) -> None:
        self.device = SimulatedCrane(
            odr_hz=RATE_HZ,
            block_samples=block_samples,
            length_m=LENGTH_M,
            position_m=POSITION_M,
            clock=SleeplessClock(),
            crane=crane,
        )
        self.info = self.device.open()
        self.configuration = validate(
            {
                "device": {"odr_hz": RATE_HZ},
                "rope": {"length_m": LENGTH_M * 1.1},  # believed wrong: the period wins
                "housing": {"position_m": POSITION_M},
                **(table or {}),
            },
            "test",
        )
        correction = correction_for(self.info, self.configuration.device.axes, None)
        self.pipeline = Pipeline(self.configuration, self.info, correction, HeaderMaker())
        self.blocks: list[SampleBlock] = []
        self.out: defaultdict[str, list[Any]] = defaultdict(list)

    def go(self, seconds: float) -> "Run":
        wanted = sum(map(len, self.blocks)) + seconds * RATE_HZ
        while sum(map(len, self.blocks)) < wanted:
            if (block := self.device.read()) is not None:
                self.feed(block)
        return self

    def feed(self, block: SampleBlock) -> None:
        self.blocks.append(block)
        self.take(self.pipeline.process(block, CLOCK).messages)

    def take(self, emissions: Iterable[OutgoingMessage]) -> None:
        for emission in emissions:
            self.out[emission.topic].append(emission.message)

    @property
    def newest_ns(self) -> int:
        return int(self.blocks[-1].time_ns[-1])


def crane(angle_deg: float = 0.0, **options: Any) -> Crane:
    motion = start_motion(math.radians(angle_deg), 0.0, 0.0, 0.0)
    return Crane(length_m=LENGTH_M, position_m=POSITION_M, gravity_m_s2=9.80665, motion=motion, **options)


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [1.5, 5.0, 12.0])
def test_a_free_swing_is_measured_and_trusted(angle_deg: float) -> None:
    run = Run(crane(angle_deg)).go(25)
    swing = run.out["swing"][-1]
    assert swing.swinging
    low, high = swing.coverage95_deg
    assert swing.phi_max_deg == pytest.approx(angle_deg, abs=max(0.05, 4 * swing.u_deg))
    assert low - 0.02 < angle_deg < high + 0.02
    assert swing.period_s == pytest.approx(2 * math.pi * math.sqrt(LENGTH_M / 9.80665), rel=0.01)
    assert run.out["condition"][-1].verdict == "swinging"
    assert run.out["condition"][-1].trusted


@pytest.mark.slow
def test_a_load_at_rest_is_static_with_an_upper_bound() -> None:
    run = Run(crane()).go(20)
    condition, alert, tilt, swing = (run.out[t][-1] for t in ("condition", "alert", "tilt", "swing"))
    assert condition.verdict == "static"
    assert alert.level == "normal"
    assert tilt.trusted
    assert tilt.axial_deg < 4 * tilt.u_deg
    assert swing.swinging is False
    assert 0 < swing.coverage95_deg[1] < 0.5


@pytest.mark.slow
def test_steady_wind_leans_and_trips_the_lean_alert() -> None:
    lean_deg = 4.0
    run = Run(crane(lean_deg, wind_m_s2=(9.80665 * math.tan(math.radians(lean_deg)), 0.0))).go(20)
    assert run.out["tilt"][-1].axial_deg == pytest.approx(lean_deg, abs=0.1)
    alert = run.out["alert"][-1]
    levels = {active.rule: active.level for active in alert.active}
    assert levels["lean"] == "trip"
    assert levels.get("swing") != "trip"  # the rope's largest angle is the lean: four degrees warn
    assert run.out["condition"][-1].verdict == "static"


@pytest.mark.slow
def test_alerts_are_raised_by_the_upper_limit_and_clear_after_the_hold_time() -> None:
    limits = {"alerts": {"warn_deg": 4.0, "trip_deg": 6.0, "clear_deg": 3.0, "hold_s": 2.0}}
    run = Run(crane(8.0, damping_ratio=0.05), limits).go(60)
    events = [(alert.level, alert.event) for alert in run.out["alert"] if alert.event in ("raised", "cleared")]
    assert events[0] == ("trip", "raised")
    assert events[-1] == ("normal", "cleared")


def test_alerts_are_unknown_before_the_first_estimate() -> None:
    run = Run(crane(2.0)).go(2)
    assert {alert.level for alert in run.out["alert"]} == {"unknown"}
    assert {condition.verdict for condition in run.out["condition"]} == {"unknown"}


@pytest.mark.slow
def test_stale_readings_are_reported_and_never_clear_an_alert() -> None:
    run = Run(crane(9.0)).go(20)
    assert run.out["alert"][-1].level == "trip"
    run.take(run.pipeline.idle(run.newest_ns + 500_000_000, CLOCK).messages)
    before = len(run.out["condition"])
    for second in range(1, 60):
        run.take(run.pipeline.idle(run.newest_ns + second * 1_000_000_000 + 1, CLOCK).messages)
    assert len(run.out["condition"]) > before
    assert run.out["condition"][-1].verdict == "unknown"
    assert "stale" in run.out["condition"][-1].reasons[0]
    assert run.out["alert"][-1].level == "trip"
    assert "not known now" in run.out["alert"][-1].text


@pytest.mark.slow
def test_fresh_samples_end_staleness() -> None:
    run = Run(crane()).go(20)
    run.take(run.pipeline.idle(run.newest_ns + 2_000_000_000, CLOCK).messages)
    assert run.out["condition"][-1].verdict == "unknown"
    run.go(1)
    assert "fresh" not in run.out["condition"][-1].gates


@pytest.mark.slow
def test_an_uncalibrated_sensor_has_no_lean() -> None:
    run = Run(crane())
    nominal = correction_for(run.info, run.configuration.device.axes, None)
    bare = replace(run.info, factory_calibration=None)
    run.pipeline = Pipeline(
        run.configuration, bare, correction_for(bare, ((0, 1), (1, 1), (2, 1)), None), HeaderMaker()
    )
    run.go(20)
    assert nominal.status == "factory"
    assert run.out["condition"][-1].calibration == "uncalibrated"
    assert "not calibrated" in run.out["alert"][-1].text
    assert run.out["tilt"][-1].u_deg > 2


@pytest.mark.slow
def test_clipped_samples_disturb() -> None:
    run = Run(crane()).go(10)
    block = present(run.device.read())
    raw = block.raw.copy()
    raw[3] = present(run.info.full_scale_g) * run.info.units_per_g
    run.feed(SampleBlock(time_ns=block.time_ns, raw=raw))
    run.go(1)
    assert run.out["condition"][-1].verdict == "disturbed"
    assert "clipped" in run.out["condition"][-1].reasons[0]


@pytest.mark.slow
def test_samples_that_the_device_marks_as_saturated_disturb_and_have_no_part_in_the_angle() -> None:
    def angle(reading: int) -> Any:
        run = Run(crane(5.0)).go(10)
        block = present(run.device.read())
        raw = block.raw.copy()
        raw[3, 0] = reading
        saturated = np.zeros(len(block), dtype=np.bool_)
        saturated[3] = True
        run.feed(replace(block, raw=raw, saturated=saturated))
        run.go(0.5)
        assert run.out["condition"][-1].verdict == "disturbed"
        assert "clipped" in run.out["condition"][-1].reasons[0]
        return [message.angle_deg for message in run.out["motion"]]

    assert angle(100_000) == angle(-100_000)


@pytest.mark.slow
def test_headers_have_sequence_numbers_and_utc() -> None:
    run = Run(crane(3.0)).go(10)
    for sent in run.out.values():
        assert [message.sequence for message in sent] == list(range(len(sent)))
        assert {message.calibration_id for message in sent} == {present(run.info.factory_calibration)["id"]}
    newest = run.out["samples"][-1]
    assert newest.time_ns == run.newest_ns + CLOCK.wall_offset_ns
    np.testing.assert_array_equal(unpack(newest).raw, run.blocks[-1].raw)


def test_the_acceleration_shows_an_impact_of_one_sample() -> None:
    run = Run(crane()).go(3)
    while (block := run.device.read()) is None:
        pass
    raw = block.raw.copy()
    raw[4, 2] += round(0.5 * run.info.units_per_g)
    run.feed(replace(block, raw=raw))
    before, hit = run.out["acceleration"][-2:]
    assert before.z_max_g == pytest.approx(1.0, abs=0.01)
    assert hit.z_max_g == pytest.approx(1.5, abs=0.01)
    assert hit.z_min_g == pytest.approx(1.0, abs=0.01)
    assert hit.z_g == pytest.approx(1.0 + 0.5 / 20, abs=0.01)  # of 0.2 s
    assert hit.time_ns == int(block.time_ns[-1]) + CLOCK.wall_offset_ns


@pytest.mark.slow
def test_the_same_blocks_give_identical_messages() -> None:
    first = Run(crane(5.0)).go(20)
    again = Run(crane(5.0))
    for block in first.blocks:
        again.feed(block)
    assert first.out == again.out


OFF_ROPE = replace(NO_SESSION, phase="collecting", method="six-position", by="ann", suspended=True)
WHY = "SUSPENDED: the sensor is being recalibrated (six-position, by ann)"


@pytest.mark.slow
def test_the_load_is_unknown_during_a_recalibration() -> None:
    run = Run(crane(9.0)).go(20)
    assert run.out["alert"][-1].level == "trip"
    before = {topic: len(messages) for topic, messages in run.out.items()}
    run.pipeline.set_session(OFF_ROPE)
    run.go(5)
    later = {topic: messages[before[topic] :] for topic, messages in run.out.items()}
    assert {alert.level for alert in later["alert"][1:]} == {
        "unknown"
    }  # the first tells of one rule, then of the other
    assert later["alert"][0].event == "changed"
    assert WHY in later["alert"][-1].text
    assert {alert.rule for alert in later["alert"][-1].active} == {rule.name for rule in ALERT_RULES}
    assert {(condition.verdict, condition.trusted) for condition in later["condition"]} == {("unknown", False)}
    assert later["condition"][0].reasons == [WHY]
    assert {(swing.swinging, swing.phi_max_deg, swing.coverage95_deg) for swing in later["swing"]} == {(None,) * 3}
    assert not any(tilt.trusted for tilt in later["tilt"])
    assert 5 <= len(later["alert"]) <= 7
    assert len(later["swing"]) >= 5


@pytest.mark.slow
def test_a_device_lost_during_a_recalibration_gives_both_reasons() -> None:
    run = Run(crane()).go(5)
    run.pipeline.set_session(OFF_ROPE)
    run.go(1)
    run.take(run.pipeline.idle(run.newest_ns + 3_000_000_000, CLOCK).messages)
    reason = run.out["condition"][-1].reasons[0]
    assert WHY in reason
    assert "stale" in reason
    assert run.out["alert"][-1].level == "unknown"


def test_the_calibration_message_contains_the_session() -> None:
    run = Run(crane()).go(1)
    assert run.out["calibration"][-1].session == NO_SESSION
    session = replace(NO_SESSION, id="session-1", phase="collecting")
    run.pipeline.set_session(session)
    message = run.pipeline.calibration_message(MessageTime(run.newest_ns, CLOCK)).message
    assert isinstance(message, messages.Calibration)
    assert message.session == session
    assert message.calibration_id == present(run.info.factory_calibration)["id"]


TRIP_DEG = 6.0
ROUND_S = 110.0
CALM_S = 25.0
STORY = ["unknown", "normal", "warn", "trip", "warn", "normal"]
CAPTIONS = [
    "Trolley starts hastily",
    "Operator catches the swing",
    "Lowering 3 m",
    "Hoisting 3 m",
    "Gust of wind",
    "Another gust",
]


@pytest.mark.slow
def test_the_demonstration_is_calm_then_trips_before_the_limit_then_clears(caplog: pytest.LogCaptureFixture) -> None:
    clock, configuration = SleeplessClock(), validate({}, "test")
    start_ns = clock.now_ns()
    device = make_device(configuration, clock)
    assert isinstance(device, SimulatedCrane)
    info = device.open()
    pipeline = Pipeline(configuration, info, correction_for(info, configuration.device.axes, None), HeaderMaker())
    alerts: list[tuple[float, Alert]] = []
    angles: list[tuple[float, float]] = []
    with caplog.at_level(logging.INFO, "plumbline.device"):
        while clock.now_ns() - start_ns < ROUND_S * 1e9:
            block = device.read()
            assert block is not None
            time_s = (int(block.time_ns[-1]) - start_ns) / 1e9
            angles.append((time_s, np.degrees(device.truth(block.time_ns[-1:]).rope_angle_rad[0])))
            out = pipeline.process(block, CLOCK).messages
            alerts += [(time_s, each.message) for each in out if isinstance(each.message, Alert)]

    changes = [
        new for old, new in zip([None, *alerts], alerts, strict=False) if not old or old[1].level != new[1].level
    ]
    assert [alert.level for _, alert in changes] == STORY
    known_s, warned_s, tripped_s, _, cleared_s = (time_s for time_s, _ in changes[1:])
    assert known_s < 0.03 * 180  # known 97 % of three minutes
    assert max(angle_deg for time_s, angle_deg in angles if time_s < warned_s) < 2.0
    assert warned_s > CALM_S
    exceeded_s = min(time_s for time_s, angle_deg in angles if angle_deg > TRIP_DEG)
    assert exceeded_s - tripped_s > 1.0
    assert cleared_s < 60.0
    assert [record.getMessage().removeprefix("simulated crane: ") for record in caplog.records] == CAPTIONS
