"""The validity of alerts: sent at once when samples end or come again, and when the housing leaves the rope."""

from dataclasses import replace
from pathlib import Path

import pytest

from gateway.messages import NO_SESSION, Alert
from gateway.pipeline.outgoing_message import OutgoingMessage
from tests.gateway.recording.recorded_crane import CLOCK, RecordedCrane

STALE_NS = 1_100_000_000


class HearingCrane(RecordedCrane):
    """Keeps the alert messages."""

    def __init__(self, folder: Path) -> None:
        self.heard: list[tuple[int, Alert]] = []
        super().__init__(folder)

    def write(self, message: OutgoingMessage) -> None:
        if isinstance(message.message, Alert):
            self.heard.append((message.log_time_ns, message.message))

    def validities(self, since: int = 0) -> list[str | None]:
        return [message.validity for _, message in self.heard[since:]]


@pytest.fixture
def crane(tmp_path: Path) -> HearingCrane:
    crane = HearingCrane(tmp_path)
    crane.record(12)
    assert crane.validities()[-1] == "valid"
    return crane


@pytest.mark.slow
def test_the_end_and_the_return_of_samples_do_not_wait_for_a_heartbeat(crane: HearingCrane) -> None:
    before = len(crane.heard)
    silent_ns = crane.newest_ns + STALE_NS
    for message in crane.pipeline.idle(silent_ns, CLOCK).messages:
        crane.write(message)
    assert (silent_ns, "no_samples") == (crane.heard[before][0], crane.heard[before][1].validity)
    before = len(crane.heard)
    crane.record(0.1)
    assert crane.validities(before)[0] != "no_samples"


@pytest.mark.slow
def test_a_housing_off_the_rope_suspends_at_once(crane: HearingCrane) -> None:
    before = len(crane.heard)
    crane.pipeline.set_session(replace(NO_SESSION, id="r-1", suspended=True), "SUSPENDED")
    crane.record(0.1)
    assert crane.validities(before)[:1] == ["suspended"]


def test_before_the_first_sample_nothing_is_known(tmp_path: Path) -> None:
    crane = HearingCrane(tmp_path)
    for message in crane.pipeline.idle(crane.newest_ns, CLOCK).messages:
        crane.write(message)
    assert crane.validities() == ["no_samples"]
