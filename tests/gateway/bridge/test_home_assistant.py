"""What Home Assistant is told, so that it finds the entities of a gateway."""

import json
import re
from typing import Any

from gateway.bridge.mqtt_messages import MqttTopics, discovery
from gateway.bridge.plant_snapshot import PlantState


def found(place: str, *, has_battery: bool = False) -> dict[str, Any]:
    messages = discovery(MqttTopics("plumbline", f"plumbline/v1/{place}"), "homeassistant", has_battery=has_battery)
    return {topic: json.loads(payload) for topic, payload in messages.items()}


def test_no_two_gateways_have_one_id_and_each_is_one_that_is_allowed() -> None:
    places = ["yard/crane-1/hook", "yard/crane_1/hook", "yard/crane.1/hook", "yard/crane/1_hook", "yard/crane_/1-hook"]
    topics = [topic for place in places for topic in found(place)]
    assert len(topics) == len(set(topics))
    assert all(re.fullmatch(r"homeassistant/sensor/[A-Za-z0-9_-]+/[a-z0-9_]+/config", topic) for topic in topics)


def test_the_state_says_why_while_the_others_are_not_available() -> None:
    entities = {entity["unique_id"].rpartition("/")[2]: entity for entity in found("yard/crane-1/hook").values()}
    assert entities["state"]["options"] == list(PlantState)
    assert [name for name, entity in entities.items() if "availability_topic" not in entity] == ["state"]


def test_a_battery_is_shown_where_there_is_one() -> None:
    wired, wireless = found("yard/crane-1/hook"), found("yard/crane-1/hook", has_battery=True)
    (battery,) = wireless.keys() - wired.keys()
    assert wireless[battery]["device_class"] == "battery"
