"""Idempotent requests, sessions after a restart, and disks that fail."""

import os
from typing import NoReturn

import pytest

from gateway.recalibration.journal import MAX_ANSWERS, Journal
from gateway.recalibration.session import MAX_CLOCK_STEP_S, MAX_IDLE_S, MAX_RESTARTS
from tests.gateway.recalibration.scripted_site import Site


@pytest.mark.parametrize("restarted", [False, True])
def test_the_same_request_has_the_same_answer_and_is_executed_once(site: Site, restarted: bool) -> None:
    began = site.start_session("begin-0001")

    def restart() -> None:
        if restarted:
            site.restart()

    restart()
    assert site.ask("recalibrate", "begin-0001", housing_off_rope=True) == began
    site.take_pose(1.0)
    site.take_pose(1.0)
    committed = site.ask("commit", "commit-001")
    restart()
    assert site.ask("commit", "commit-001") == committed
    rolled = site.ask("rollback", "rollback-1")
    restart()
    assert site.ask("rollback", "rollback-1") == rolled
    refused = site.ask("rollback", "rollback-2")
    assert not refused.accepted
    restart()
    assert site.ask("rollback", "rollback-2") == refused
    assert len(site.store.state().history) == 2


def test_an_id_belongs_to_one_request(site: Site) -> None:
    site.start_session("request-a")
    answer = site.ask("cancel", "request-a")
    assert not answer.accepted
    assert "another request" in answer.text
    answer = site.ask("recalibrate", "request-a", by="bob", housing_off_rope=True)
    assert not answer.accepted
    assert site.session.is_active


@pytest.mark.slow
def test_a_bounded_number_of_answers_is_kept_and_executed_requests_are_found_longer(site: Site) -> None:
    site.commit(1.0)
    done = site.ask("rollback", "rollback-x")
    for _ in range(MAX_ANSWERS // 2):
        site.start_session()
        assert site.ask("cancel").accepted
    journal = (site.data_dir / "calibration" / "session.json").read_text()
    assert journal.count('"accepted"') == MAX_ANSWERS
    again = site.restart().ask("rollback", "rollback-x")
    assert done.accepted
    assert again.accepted
    assert len(site.store.state().history) == 2


def test_refused_requests_write_no_journal_and_displace_no_answer(site: Site) -> None:
    site.commit(1.0)
    done = site.ask("rollback", "rollback-x")
    path = site.data_dir / "calibration" / "session.json"
    before = path.read_bytes()
    refused = site.ask("cancel", "refused-1")
    for _ in range(2 * MAX_ANSWERS):
        assert not site.ask("cancel").accepted
    assert path.read_bytes() == before
    assert site.ask("rollback", "rollback-x") == done
    assert not refused.accepted


def test_a_session_continues_after_a_restart(site: Site) -> None:
    site.start_session()
    site.take_pose(5.0)
    before = site.session
    site.now_ns += 20_000_000_000
    site.restart()
    assert site.session == before.resume()
    site.take_pose(6.0)
    assert site.phase() == "review"
    reviewed = site.session
    site.restart()
    assert site.session == reviewed.resume()
    assert site.ask("commit").accepted
    assert list(site.record_in_force().offset) == [5.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("away_s", "text"),
    [(MAX_IDLE_S + 1, "no pose was taken"), (-MAX_CLOCK_STEP_S - 2, "the clock was set back")],
)
def test_a_session_ends_after_too_long_a_stop(site: Site, away_s: float, text: str) -> None:
    site.start_session()
    site.take_pose()
    site.now_ns += round(away_s * 1e9)
    site.restart()
    assert site.phase() == "rejected"
    assert text in site.session.text


@pytest.mark.slow
def test_a_session_ends_after_many_restarts_without_a_pose(site: Site) -> None:
    site.start_session()
    for _ in range(MAX_RESTARTS):
        site.restart()
        assert site.phase() == "collecting"
    site.take_pose()
    for _ in range(MAX_RESTARTS):
        site.restart()
        assert site.phase() == "collecting"
    site.restart()
    assert site.phase() == "rejected"
    assert f"{MAX_RESTARTS} times" in site.session.text


def test_an_exchanged_sensor_ends_the_session_and_inherits_no_record(site: Site) -> None:
    site.commit(1.0)
    site.review(2.0)
    site.restart(device_id="part-8")
    assert site.phase() == "rejected"
    assert "exchanged" in site.session.text
    assert site.store.in_force() is None
    assert not site.ask("commit").accepted


def test_a_record_in_force_before_a_kill_is_found_committed(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed between the rename of `in_force.json` and the journal."""
    site.review(1.0)
    with monkeypatch.context() as patch:
        patch.setattr(Journal, "save", fail)
        site.ask("commit", "commit-001")
    site.restart()
    assert site.phase() == "committed"
    assert site.in_force() == site.session.record_id
    assert site.ask("commit", "commit-001").accepted
    assert len(site.store.state().history) == 1


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"format": 1, "session": {"id": 5}, "answers": []}'])
def test_a_damaged_journal_ends_the_session_and_is_reported(site: Site, content: bytes) -> None:
    before = site.commit(1.0)
    site.start_session()
    (site.data_dir / "calibration" / "session.json").write_bytes(content)
    site.restart()
    assert site.phase() == "rejected"
    assert "SUSPENDED" in site.suspension
    assert site.in_force() == before
    assert any("session.json" in line and "has ended" in line for line in site.log_lines)
    site.start_session()


def fail(*_arguments: object, **_options: object) -> NoReturn:
    raise OSError(28, "No space left on device")


def test_a_request_is_refused_if_it_cannot_be_audited(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", fail)
        answer = site.ask("recalibrate", housing_off_rope=True)
    assert (answer.accepted, "No space left" in answer.text) == (False, True)
    assert site.recalibration.session is None


@pytest.mark.slow
@pytest.mark.parametrize("call", ["replace", "fsync"])
def test_a_failing_disk_leaves_the_old_record_in_force(site: Site, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    before = site.commit(1.0)
    site.review(2.0)
    with monkeypatch.context() as patch:
        patch.setattr(os, call, fail)
        answer = site.ask("commit")
    assert not answer.accepted
    assert site.in_force() == before
    assert site.phase() == "review"
    assert site.ask("commit").accepted


def test_a_session_that_cannot_be_saved_ends(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.start_session()
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fail)
        site.take_pose()
    assert site.phase() == "rejected"
    assert "cannot be saved" in site.session.text
