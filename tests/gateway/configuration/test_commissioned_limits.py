"""Limits that were changed over the bus are said until they are as commissioned again, or a person accepts them."""

from pathlib import Path

import pytest

from gateway.configuration.model import AlertsSection
from gateway.configuration.remote_change import NAME, describe_changes, note_change

COMMISSIONED = AlertsSection()
OPENED = AlertsSection(trip_deg=15.0)


def test_a_limit_that_came_over_the_bus_is_said_until_it_is_put_back(tmp_path: Path) -> None:
    assert describe_changes(tmp_path, OPENED) == []  # set by a person on the machine
    note_change(tmp_path, COMMISSIONED, OPENED)
    (line,) = describe_changes(tmp_path, OPENED)
    assert "alerts.trip_deg is 15, changed over the bus; at commissioning it was 6" in line
    note_change(tmp_path, OPENED, COMMISSIONED)
    assert describe_changes(tmp_path, COMMISSIONED) == []


def test_a_second_change_hides_nothing_of_the_first(tmp_path: Path) -> None:
    note_change(tmp_path, COMMISSIONED, OPENED)
    both = AlertsSection(trip_deg=15.0, hold_s=60.0)
    note_change(tmp_path, OPENED, both)
    assert [line.split()[0] for line in describe_changes(tmp_path, both)] == ["alerts.trip_deg", "alerts.hold_s"]
    further = AlertsSection(trip_deg=14.0, hold_s=60.0)
    note_change(tmp_path, both, further)
    assert "at commissioning it was 6;" in describe_changes(tmp_path, further)[0]


def test_a_limit_that_a_person_sets_in_the_file_is_commissioned(tmp_path: Path) -> None:
    note_change(tmp_path, COMMISSIONED, OPENED)
    by_hand = AlertsSection(trip_deg=8.0)
    assert describe_changes(tmp_path, by_hand) == []
    note_change(tmp_path, by_hand, OPENED)
    assert "at commissioning it was 8;" in describe_changes(tmp_path, OPENED)[0]


def test_a_change_that_was_rolled_back_is_none(tmp_path: Path) -> None:
    note_change(tmp_path, COMMISSIONED, OPENED)
    assert describe_changes(tmp_path, COMMISSIONED) == []


@pytest.mark.slow
def test_no_flipped_bit_and_no_cut_makes_changed_limits_look_commissioned(tmp_path: Path) -> None:
    note_change(tmp_path, COMMISSIONED, OPENED)
    path = tmp_path / NAME
    whole = path.read_bytes()
    for bit in range(8 * len(whole)):
        content = bytearray(whole)
        content[bit // 8] ^= 1 << bit % 8
        path.write_bytes(content)
        assert describe_changes(tmp_path, OPENED), bit
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert describe_changes(tmp_path, OPENED), length
    note_change(tmp_path, OPENED, COMMISSIONED)  # a damaged file is not replaced without a person
    assert "cannot be read" in describe_changes(tmp_path, COMMISSIONED)[0]


def test_a_link_to_nothing_is_not_taken_for_a_gateway_without_changes(tmp_path: Path) -> None:
    (tmp_path / NAME).parent.mkdir()
    (tmp_path / NAME).symlink_to("nowhere")
    assert "cannot be read" in describe_changes(tmp_path, OPENED)[0]
