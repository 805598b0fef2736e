"""The trial of a changed configuration: whatever is cut off, the file is the one before or the one after, and the trial ends."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from gateway.configuration.remote_change import MAX_TRIAL_STARTS, ConfigurationTrial, TrialJournal

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
