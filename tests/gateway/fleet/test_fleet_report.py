"""Filters, order, exit verdict and text of a list of gateways."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from gateway.errors import InputError
from gateway.fleet.gateway_status import FleetWord, GatewayStatus, SwingReading, missing_gateway
from gateway.fleet.report import FleetQuery, FleetReport, format_age, format_table, make_report
from gateway.fleet.selection import SORTS, ListFilter, NamePatterns, parse_levels, parse_states, read_expected

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)


def key(name: str) -> str:
    return f"plumbline/v1/{name}"


def status(name: str, state: FleetWord = "OK", **known: Any) -> GatewayStatus:
    return GatewayStatus(key=key(name), state=state, reasons=known.pop("reasons", ()), alive=True, **known)


FLEET = [
    status("yard-a/c1/hook", level="normal", swing=SwingReading(swinging=True, phi_max_deg=2.0, u_deg=0.1, upper95_deg=2.2)),
    status("yard-a/c2/hook", "TRIP", level="trip", reasons=("over the limit",), battery_percent=20.0),
    status("yard-b/c1/hook", "DISTURBED", level="normal", battery_percent=10.0, seen_s=3.0),
    missing_gateway(key("yard-b/c9/hook")),
]  # fmt: skip


def report(
    query: FleetQuery | None = None, connected: bool = True, expected: frozenset[str] = frozenset()
) -> FleetReport:
    return make_report(FLEET, query or FleetQuery(), expected=expected, connected=connected, invalid=0, time_utc=NOW)


def names(found: FleetReport) -> list[str]:
    return [listed.name for listed in found.listed]


@pytest.mark.parametrize(
    ("device", "label"), [("simulated", "OK SIMULATION"), ("replay", "OK REPLAY"), ("adxl355", "OK"), (None, "OK")]
)
def test_what_no_sensor_measures_is_marked_in_the_list(device: str | None, label: str) -> None:
    shown = status("yard-a/c1/hook", device=device)
    assert shown.label == label
    assert format_table([shown])[1].split("  ")[1] == label


def test_the_most_urgent_gateway_comes_first() -> None:
    assert names(report()) == ["yard-a/c2/hook", "yard-b/c9/hook", "yard-b/c1/hook", "yard-a/c1/hook"]
    assert names(report(FleetQuery(sort="name")))[0] == "yard-a/c1/hook"
    assert names(report(FleetQuery(sort="battery")))[:2] == ["yard-b/c1/hook", "yard-a/c2/hook"]
    assert names(report(FleetQuery(sort="swing")))[0] == "yard-a/c1/hook"
    for sort in SORTS:
        assert len(names(report(FleetQuery(sort=sort)))) == len(FLEET)


def test_patterns_of_names_narrow_what_is_judged() -> None:
    found = report(FleetQuery(NamePatterns(site="yard-a", crane="c[1]")))
    assert (names(found), found.well) == (["yard-a/c1/hook"], True)
    assert not report(FleetQuery(NamePatterns(site="yard-?"))).well
    assert not report(FleetQuery(NamePatterns(site="no-such-site"))).well


def test_a_whole_name_narrows_what_the_bus_sends() -> None:
    assert NamePatterns(site="yard-a", crane="c*").key_pattern == "plumbline/v1/yard-a/*/*"


def test_states_and_levels_narrow_the_list_but_not_the_verdict() -> None:
    found = report(FleetQuery(listed=ListFilter(states=parse_states("ok"))))
    assert (names(found), found.well) == (["yard-a/c1/hook"], False)
    assert names(report(FleetQuery(listed=ListFilter(levels=parse_levels("trip"))))) == ["yard-a/c2/hook"]


def test_labels_and_words_name_the_same_state() -> None:
    assert parse_states("limit, no data") == parse_states("TRIP,no_data") == {"TRIP", "NO DATA"}
    with pytest.raises(ValueError, match="broken: choose from"):
        parse_states("broken")
    with pytest.raises(ValueError, match="choose from normal"):
        parse_levels("high")


def test_an_accepted_state_is_no_fault_and_a_lost_router_always_is_one() -> None:
    crane = NamePatterns(site="yard-b", crane="c1")
    assert not report(FleetQuery(crane)).well
    accepting = FleetQuery(crane, accepted=parse_states("disturbed"))
    assert report(accepting).well
    lost = report(accepting, connected=False)
    assert not lost.well
    assert lost.lines()[0].startswith("no connection to the router")


def test_the_first_line_is_the_summary_and_the_reason_stands_in_the_row() -> None:
    lines = report().lines()
    assert lines[0] == "4 gateways, 3 not well: 1 LIMIT, 1 MISSING, 1 DISTURBED, 1 OK"
    assert lines[2].split()[:3] == ["yard-a/c2/hook", "LIMIT", "trip"]
    assert lines[2].endswith("over the limit")
    assert "2.00 deg u 0.10" in lines[5]


def test_control_characters_of_a_message_never_reach_a_terminal() -> None:
    hostile = status("a/b/c", "TRIP", reasons=("\x1b]0;owned\x07\nplumbline/v1/forged  OK",), software="\x1b[2J1.0")
    found = make_report([hostile], FleetQuery(), expected=frozenset(), connected=True, invalid=3, time_utc=NOW)
    text = "\n".join(found.lines())
    assert not [character for character in text if not character.isprintable() and character != "\n"]
    assert len(found.lines()) == 4
    assert "\x1b" not in json.dumps(found.as_json())


def test_gateways_that_nobody_expects_are_noted_and_are_no_fault() -> None:
    crane = FleetQuery(NamePatterns(site="yard-a", crane="c1"))
    found = report(crane, expected=frozenset({key("yard-a/c2/hook")}))
    assert found.well
    assert found.lines()[-1] == "note: not on the list of expected gateways: yard-a/c1/hook"


def test_the_json_has_every_gateway_with_its_names() -> None:
    content = report().as_json()
    assert content["counts"] == {"OK": 1, "TRIP": 1, "DISTURBED": 1, "MISSING": 1}
    assert content["gateways"][0]["site"] == "yard-a"
    assert content["not_well"] == [key("yard-a/c2/hook"), key("yard-b/c1/hook"), key("yard-b/c9/hook")]


def test_expected_gateways_are_read_with_comments_and_whole_keys(tmp_path: Path) -> None:
    path = tmp_path / "gateways.txt"
    path.write_text("# north\nyard/c1/hook   # the old one\n\nplumbline/v1/yard/c2/hook  second-gateway\n")
    assert read_expected(path) == {key("yard/c1/hook"): "c1", key("yard/c2/hook"): "second-gateway"}


@pytest.mark.parametrize(
    ("text", "problem"),
    [("yard/c1/hook\nyard/c*/hook\n", "line 2: 'yard/c\\*/hook' is no gateway"), ("# none\n", "names no gateway")],
)
def test_a_wrong_list_of_expected_gateways_names_the_line(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "gateways.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=problem):
        read_expected(path)


@pytest.mark.parametrize(
    ("age_s", "text"), [(0.4, "0 s"), (90.0, "90 s"), (600.0, "10 min"), (7300.0, "2 h"), (4e5, "5 d")]
)
def test_ages_have_the_largest_fitting_unit(age_s: float, text: str) -> None:
    assert format_age(age_s) == text


def test_what_cannot_be_seen_comes_behind_the_alarms_that_stand_and_first_of_it_what_was_in_alarm() -> None:
    fleet = [
        missing_gateway(key("a/1/hook")),
        status("a/2/hook", "UNCALIBRATED"),
        status("a/3/hook", "STALE"),
        status("a/4/hook", "GONE", last_alarm="WARN"),
        status("a/5/hook", "STALE", last_alarm="TRIP"),
        status("a/6/hook", "GONE"),
        status("a/7/hook", "WARN"),
        status("a/8/hook", "TRIP"),
    ]
    found = make_report(fleet, FleetQuery(), expected=frozenset(), connected=True, invalid=0, time_utc=NOW)
    assert [name.split("/")[1] for name in names(found)] == list("87546312")
