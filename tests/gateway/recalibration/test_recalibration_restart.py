"""The same request is done once; a session goes on after a restart, or ends; a disk that refuses changes nothing."""

import os

import pytest

from gateway.recalibration.journal import MOST_ANSWERS
from gateway.recalibration.session import CLOCK_SLACK_S, IDLE_S, MOST_RESTARTS


@pytest.mark.parametrize("restarted", [False, True])
def test_the_same_request_has_the_same_answer_and_is_done_once(site, restarted):
    began = site.begin("begin-0001")
    again = lambda: site.start() if restarted else None  # noqa: E731
    again()
    assert site.ask("recalibrate", "begin-0001", housing_off_rope=True) == began
    site.pose(1.0)
    site.pose(1.0)
    committed = site.ask("commit", "commit-001")
    again()
    assert site.ask("commit", "commit-001") == committed
    rolled = site.ask("rollback", "rollback-1")
    again()
    assert site.ask("rollback", "rollback-1") == rolled
    refused = site.ask("rollback", "rollback-2")
    assert not refused.accepted
    again()
    assert site.ask("rollback", "rollback-2") == refused
    assert len(site.store.state().history) == 2


def test_an_id_belongs_to_one_request(site):
    site.begin("request-a")
    answer = site.ask("cancel", "request-a")
    assert not answer.accepted
    assert "another request" in answer.text
    answer = site.ask("recalibrate", "request-a", by="bob", housing_off_rope=True)
    assert not answer.accepted
    assert site.session.active


@pytest.mark.slow
def test_answers_are_remembered_within_bounds_and_what_was_done_longer(site):
    site.commit(1.0)
    done = site.ask("rollback", "rollback-x")
    for _ in range(2 * MOST_ANSWERS):
        assert not site.ask("cancel").accepted
    journal = (site.data_dir / "calibration" / "session.json").read_text()
    assert journal.count('"accepted"') == MOST_ANSWERS
    again = site.start().ask("rollback", "rollback-x")
    assert done.accepted
    assert again.accepted
    assert len(site.store.state().history) == 2


def test_a_session_goes_on_after_a_restart(site):
    site.begin()
    site.pose(5.0)
    before = site.session
    site.now_ns += 20_000_000_000
    site.start()
    assert site.session == before.resumed()
    site.pose(6.0)
    assert site.session.phase == "review"
    reviewed = site.session
    site.start()
    assert site.session == reviewed.resumed()
    assert site.ask("commit").accepted
    assert list(site.store.in_force().offset) == [5.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("away_s", "said"),
    [(IDLE_S + 1, "no pose was taken"), (-CLOCK_SLACK_S - 2, "the clock went back")],
)
def test_a_session_that_was_away_too_long_ends(site, away_s, said):
    site.begin()
    site.pose()
    site.now_ns += round(away_s * 1e9)
    site.start()
    assert site.session.phase == "rejected"
    assert said in site.session.text


def test_a_session_that_may_be_what_ends_the_gateway_does_not_go_on_for_ever(site):
    site.begin()
    for _ in range(MOST_RESTARTS):
        site.start()
        assert site.session.phase == "collecting"
    site.pose()
    for _ in range(MOST_RESTARTS):
        site.start()
        assert site.session.phase == "collecting"
    site.start()
    assert site.session.phase == "rejected"
    assert f"{MOST_RESTARTS} times" in site.session.text


def test_a_swapped_sensor_ends_the_session_and_inherits_nothing(site):
    site.commit(1.0)
    site.review(2.0)
    site.start(device_id="part-8")
    assert site.session.phase == "rejected"
    assert "exchanged" in site.session.text
    assert site.store.in_force() is None
    assert not site.ask("commit").accepted


def test_a_record_that_came_into_force_before_the_kill_is_found_committed(site, monkeypatch):
    """Killed between the rename of `in_force.json` and the journal."""
    site.review(1.0)
    monkeypatch.setattr(site.recalibration._journal, "save", lambda *_: (_ for _ in ()).throw(OSError(5, "gone")))
    site.ask("commit", "commit-001")
    site.start()
    assert site.session.phase == "committed"
    assert site.in_force == site.session.record_id
    assert site.ask("commit", "commit-001").accepted
    assert len(site.store.state().history) == 1


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"format": 1, "session": {"id": 5}, "answers": []}'])
def test_a_spoilt_journal_ends_the_session_and_says_so(site, content):
    before = site.commit(1.0)
    site.begin()
    (site.data_dir / "calibration" / "session.json").write_bytes(content)
    site.start()
    assert site.session.phase == "rejected"
    assert "SUSPENDED" in site.recalibration.suspended
    assert site.in_force == before
    assert any("session.json" in line and "has ended" in line for line in site.told)
    site.begin()


def refuse(*_arguments, **_options):
    raise OSError(28, "No space left on device")


def test_without_an_audit_nothing_is_done(site, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", refuse)
        answer = site.ask("recalibrate", housing_off_rope=True)
    assert (answer.accepted, "No space left" in answer.text) == (False, True)
    assert site.session is None


@pytest.mark.parametrize("call", ["replace", "fsync"])
def test_a_disk_that_refuses_leaves_the_old_record_in_force(site, monkeypatch, call):
    before = site.commit(1.0)
    site.review(2.0)
    with monkeypatch.context() as patch:
        patch.setattr(os, call, refuse)
        answer = site.ask("commit")
    assert not answer.accepted
    assert site.in_force == before
    assert site.session.phase == "review"
    assert site.ask("commit").accepted


def test_a_session_that_cannot_be_kept_does_not_go_on(site, monkeypatch):
    site.begin()
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", refuse)
        site.pose()
    assert site.session.phase == "rejected"
    assert "cannot be kept" in site.session.text
