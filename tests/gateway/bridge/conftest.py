"""A gateway that is not there: its messages, as a bridge hears them."""

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from gateway.bridge.heard_messages import HeardMessages
from gateway.bridge.plant_snapshot import PlantSnapshot
from gateway.bus.authenticity import Doubt
from gateway.bus.fleet_inbox import FleetInbox
from gateway.messages import Message
from gateway.topics import TOPIC_OF, encode
from tests.gateway.scene import SAMPLE_TIME_NS, Scene

KEY = "plumbline/v1/north-yard/crane-3/hook"
NOW_UTC = datetime.fromtimestamp(SAMPLE_TIME_NS / 1e9, UTC)


class Listener:
    """A scene, and what a bridge that listens to it knows."""

    def __init__(self, *, demonstration: bool = False, allow_unsigned: bool = False) -> None:
        self.scene = Scene()
        self.changes: dict[str, dict[str, Any]] = {"alert": {"validity": "valid", "boot_id": "b00t", "alert_number": 7}}
        """Fields that differ from those of the scene, by topic."""
        self.linked = True
        self.inbox = FleetInbox()
        self.heard = HeardMessages(KEY, demonstration=demonstration, allow_unsigned=allow_unsigned)

    def hear(
        self,
        at_s: float,
        topics: tuple[str, ...] = ("motion", "alert", "health", "calibration"),
        *,
        live: bool = True,
        doubt: Doubt | None = None,
    ) -> None:
        """The gateway sends a message of each topic, and the bridge takes them."""
        self.inbox.put_alive(f"{KEY}/alive", True)
        for message in self.scene.messages(0, SAMPLE_TIME_NS + round(1e9 * at_s)):
            topic = TOPIC_OF[type(message)].name
            if topic in topics:
                changed: Message = replace(message, **self.changes.get(topic, {}))
                self.inbox.put(f"{KEY}/{topic}", encode(changed), at_s, live=live, doubt=doubt)
        self.take(at_s)

    def take(self, now_s: float) -> None:
        self.heard.take(self.inbox.drain(), now_s, is_linked=self.linked)

    def snapshot(self, now_s: float) -> PlantSnapshot:
        self.take(now_s)
        return self.heard.snapshot(now_s, NOW_UTC)


@pytest.fixture
def listener() -> Listener:
    return Listener()
