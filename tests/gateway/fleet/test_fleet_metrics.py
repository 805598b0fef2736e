"""The metrics of many gateways are one exposition."""

import re
from dataclasses import replace

from gateway.fleet.fleet_servers import format_fleet
from gateway.fleet.gateway_status import missing_gateway
from gateway.messages import ActiveAlert, Message
from gateway.page.metrics import Counters, format_exposition, gauge, labelled_gauge, render, with_labels
from gateway.page.verdict import PageEvidence
from gateway.topics import TOPIC_OF
from tests.gateway.scene import Scene

PLACE = {"site": "y", "crane": "c1", "sensor": "h"}


def evidence(*changed: Message) -> PageEvidence:
    latest = {TOPIC_OF[type(message)].name: message for message in (*Scene().messages(0, 1), *changed)}
    return PageEvidence(True, latest, dict.fromkeys(latest, 0.25), 1.0)


def everything() -> PageEvidence:
    """What a gateway with a radio sensor, a relay, a drift monitor, an old record and an open incident says."""
    scene = Scene()
    health = replace(
        scene.health(),
        battery_v=3.1, battery_percent=50.0, battery_low=False, signal_dbm=-70.0, relay="energised",
        certificate_days_left=20, refused={"role": 1},
        standing_faults={"recording": "the disk is full"},
        alert_latency_ms={"count": 2, "p50": 10.0, "p99": 20.0, "max": 30.0}, drift={"norm_error_mg": 1.0, "state": "ok"},
    )  # fmt: skip
    active = ActiveAlert(rule="swing", level="trip", since_ns=0, incident="b-1", acknowledged_by="ann", text="t")
    alert = replace(scene.alert(), level="trip", active=[active], alert_number=7)
    calibration = replace(scene.calibrated(), record={"created_utc": "2026-01-01T00:00:00Z"})
    return evidence(health, alert, calibration)


def test_one_group_holds_the_samples_of_all_gateways() -> None:
    both = {"plumbline/v1/y/c1/h": evidence(), "plumbline/v1/y/c2/h": evidence()}
    text = format_fleet(both, [missing_gateway("plumbline/v1/y/c9/h")], connected=True, invalid=3)
    families = re.findall(r"^# TYPE (\w+)", text, re.M)
    assert len(families) == len(set(families))
    group = text.split("# TYPE plumbline_up gauge\n")[1].split("#")[0]
    assert group.splitlines() == [f'plumbline_up{{site="y",crane="{crane}",sensor="h"}} 1' for crane in ("c1", "c2")]
    assert 'plumbline_fleet_gateway_missing{site="y",crane="c9",sensor="h"} 1' in text
    assert 'plumbline_fleet_gateways{state="MISSING"} 1' in text
    assert "plumbline_fleet_invalid_messages_total{} 3" in text


def test_an_open_incident_has_its_rule_its_level_and_its_acknowledgement() -> None:
    text = format_exposition(everything(), Counters({}, 0, 0, 0), PLACE)
    labels = 'site="y",crane="c1",sensor="h",rule="swing"'
    assert f'plumbline_alert_rule_level{{{labels},level="trip"}} 1' in text
    assert f"plumbline_incident_open{{{labels}}} 1" in text
    assert f"plumbline_incident_acknowledged{{{labels}}} 1" in text
    assert 'plumbline_certificate_remaining_seconds{site="y",crane="c1",sensor="h"} 1728000' in text
    assert 'plumbline_alert_changes_total{site="y",crane="c1",sensor="h"} 7' in text
    assert 'plumbline_alert_latency_seconds{site="y",crane="c1",sensor="h",statistic="p99"} 0.02' in text


def test_a_dead_gateway_has_an_unknown_level_and_no_open_incident() -> None:
    text = format_exposition(replace(everything(), gateway=False), Counters({}, 0, 0, 0), PLACE)
    assert 'plumbline_alert_level{site="y",crane="c1",sensor="h",level="unknown"} 1' in text
    assert 'rule="swing",level="unknown"} 1' in text
    assert "plumbline_incident_open" not in text
    assert "plumbline_phi_max_degrees" not in text


def test_names_follow_the_conventions_of_prometheus() -> None:
    text = format_exposition(everything(), Counters({"tilt": 1}, 0, 0, 0), PLACE)
    kinds = dict(re.findall(r"^# TYPE (\w+) (\w+)$", text, re.M))
    assert {name.endswith("_total") == (kind == "counter") for name, kind in kinds.items()} == {True}
    assert [name for name in kinds if re.search("milli|mega|percent|_mb$|_ms$", name)] == []


def test_values_that_are_not_known_are_left_out_and_labels_are_escaped() -> None:
    families = [gauge("a", "A.", None), labelled_gauge("b", "k", "B.", {'x"\n\\': 1.5, "y": None})]
    text = render(with_labels(families, {"site": "s"}))
    assert text == '# HELP plumbline_b B.\n# TYPE plumbline_b gauge\nplumbline_b{site="s",k="x\\"\\n\\\\"} 1.5\n'
