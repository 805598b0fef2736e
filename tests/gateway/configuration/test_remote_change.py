"""Changes over the bus: whatever is cut off, the file is the one before or the one after; changed limits are said.

A trial ends. Changed limits are said until they are as commissioned again, or a person accepts them.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from gateway.configuration.model import AlertsSection
from gateway.configuration.remote_change import (
    MAX_TRIAL_STARTS,
    NAME,
    ConfigurationTrial,
    TrialJournal,
    describe_changes,
    note_change,
)

BEFORE, AFTER = "[rope]\nlength_m = 12.0\n", "[rope]\nlength_m = 14.0\n"
JOURNAL = TrialJournal(id="a" * 12, by="ann", reason="", before=BEFORE, after=AFTER, kept="plumbline.toml.until-1")


class Killed(BaseException):
    """The process ends here."""


class Killer:
    """Ends the process at its n-th call to the disk: that call and all later ones do not happen."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, at: int) -> None:
        self._left = at
        for owner, name in (
            (os, "open"),
            (os, "write"),
            (os, "fsync"),
            (Path, "replace"),
            (Path, "unlink"),
            (Path, "chmod"),
        ):
            monkeypatch.setattr(owner, name, self._counted(getattr(owner, name)))

    def _counted(self, call: Callable[..., object]) -> Callable[..., object]:
        def counted(*arguments: object, **options: object) -> object:
            self._left -= 1
            if self._left < 0:
                raise Killed
            return call(*arguments, **options)

        return counted

    @property
    def survived(self) -> bool:
        return self._left >= 0


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "plumbline.toml"
    path.write_text(BEFORE)
    path.chmod(0o640)
    return path


def _begin(path: Path) -> None:
    ConfigurationTrial(path).begin(JOURNAL)


def _resume(path: Path) -> None:
    ConfigurationTrial(path).resume()


def _confirm(path: Path) -> None:
    ConfigurationTrial(path).end()


def _roll_back(path: Path) -> None:
    ConfigurationTrial(path).roll_back("not healthy")


@pytest.mark.slow
@pytest.mark.parametrize("step", [_begin, _resume, _confirm, _roll_back])
def test_a_kill_at_every_call_to_the_disk_leaves_one_of_the_two_files(step: Callable[[Path], None], path: Path) -> None:
    for at in range(60):
        path.write_text(BEFORE)
        if step is not _begin:
            _begin(path)
        with pytest.MonkeyPatch.context() as monkeypatch, suppress(Killed):
            killer = Killer(monkeypatch, at)
            step(path)
        after_kill, on_trial = path.read_text(), ConfigurationTrial(path).journal() is not None
        assert after_kill in (BEFORE, AFTER)
        assert on_trial or after_kill == (AFTER if step is _confirm else BEFORE), "a new configuration is on trial"
        outcomes = [ConfigurationTrial(path).resume() for _ in range(MAX_TRIAL_STARTS + 2)]
        assert outcomes[-1] == ("rolled_back" if on_trial else "none")
        assert path.read_text() == (BEFORE if on_trial else after_kill)
        ConfigurationTrial(path).end()
        assert ConfigurationTrial(path).resume() == "none"
        if killer.survived:
            break
    else:
        pytest.fail("more calls to the disk than this test cuts off")
    assert at >= (1 if step is _confirm else 4)


def test_a_gateway_that_never_becomes_healthy_gets_the_configuration_before(path: Path) -> None:
    _begin(path)
    assert path.read_text() == AFTER
    assert path.with_name(JOURNAL.kept).read_text() == BEFORE
    outcomes = [ConfigurationTrial(path).resume() for _ in range(MAX_TRIAL_STARTS + 1)]
    assert outcomes == ["continued"] * MAX_TRIAL_STARTS + ["rolled_back"]
    journal = ConfigurationTrial(path).journal()
    assert journal is not None
    assert journal.rolled_back == "the gateway did not become healthy in 3 starts"
    assert path.read_text() == BEFORE
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_confirmed_configuration_stays(path: Path) -> None:
    _begin(path)
    trial = ConfigurationTrial(path)
    assert trial.resume() == "continued"
    trial.end()
    assert [trial.resume() for _ in range(5)] == ["none"] * 5
    assert path.read_text() == AFTER


def test_an_edit_on_the_machine_wins_over_a_trial(path: Path) -> None:
    _begin(path)
    path.write_text("[rope]\nlength_m = 9.0\n")
    assert ConfigurationTrial(path).resume() == "edited_locally"
    assert path.read_text() == "[rope]\nlength_m = 9.0\n"
    assert ConfigurationTrial(path).resume() == "none"


def test_a_damaged_journal_is_put_aside(path: Path) -> None:
    journal = path.with_name("plumbline.toml.trial.json")
    journal.write_text("{")
    assert ConfigurationTrial(path).resume() == "unreadable"
    assert not journal.exists()
    assert path.read_text() == BEFORE


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
