"""The session's way from request to record: what moves it on, what ends it, and what is refused."""

import numpy as np
import pytest

from gateway.calibration.acceptance import Acceptance
from gateway.calibration.record import CalibrationError
from gateway.recalibration.session import IDLE_S, REVIEW_S, WHOLE_S


def test_the_whole_way(site):
    assert site.session is None
    site.begin("session-1")
    assert site.session.phase == "collecting"
    assert "SUSPENDED" in site.recalibration.suspended
    site.pose()
    assert len(site.session.poses) == 1
    site.pose()
    assert site.session.phase == "review"
    assert site.recalibration.suspended is not None
    assert site.in_force is None
    answer = site.ask("commit", by="bob", reason="new clamp", record=site.session.record_id)
    assert answer.accepted
    assert site.session.phase == "committed"
    assert site.recalibration.suspended is None
    assert site.pipeline_changed
    record = site.store.in_force()
    assert record.id == answer.content["record"]
    assert (record.by, record.parent, record.device_id) == ("ann", None, "part-7")
    (change,) = site.store.state().history
    assert (change.by, change.reason) == ("bob", "new clamp")


def test_a_second_record_has_the_first_as_its_parent_which_stays(site):
    first = site.commit(1.0)
    second = site.commit(2.0)
    assert site.store.in_force().parent == first
    assert site.store.ids() == sorted([first, second])


def test_one_session_at_a_time(site):
    site.begin()
    for verb in ("recalibrate", "zero", "rollback"):
        answer = site.ask(verb, by="bob")
        assert not answer.accepted
        assert "a session is under way (six-position, begun by ann)" in answer.text


@pytest.mark.parametrize(
    ("poses", "wait_s", "said"),
    [(0, IDLE_S, "no pose"), (1, IDLE_S, "no pose"), (2, REVIEW_S, "not committed")],
)
def test_a_session_that_is_left_ends(site, poses, wait_s, said):
    site.begin()
    for _ in range(poses):
        site.pose()
    site.later(wait_s - 1)
    assert site.session.active
    site.later(2)
    assert site.session.phase == "rejected"
    assert said in site.session.text
    assert site.in_force is None


@pytest.mark.parametrize("restarted", [False, True])
def test_alerts_stay_suspended_after_a_session_that_was_left_until_somebody_says_that_the_housing_is_back(
    site, restarted
):
    site.begin()
    site.later(IDLE_S + 1)
    if restarted:
        site.start()
    assert "has ended" in site.recalibration.suspended
    assert site.ask("cancel", by="bob").accepted
    assert site.recalibration.suspended is None
    assert site.pipeline_changed
    assert site.session.phase == "rejected"
    assert not site.ask("cancel").accepted
    site.begin()
    assert site.ask("cancel").accepted
    assert site.recalibration.suspended is None


def test_a_session_cannot_go_on_for_ever(site):
    site.begin()
    site.pose()
    for _ in range(int(WHOLE_S / IDLE_S) + 1):
        session = site.session
        site.recalibration.session = session.model_copy(update={"touched_ns": site.now_ns})
        site.later(IDLE_S - 1)
    assert site.session.phase == "rejected"
    assert "lasted longer" in site.session.text


def test_cancel_ends_it_and_the_old_record_stays(site):
    before = site.commit(1.0)
    site.review(2.0)
    answer = site.ask("cancel", by="bob")
    assert answer.accepted
    assert (site.session.phase, site.session.text) == ("rejected", "cancelled by bob")
    assert site.recalibration.suspended is None
    assert site.in_force == before
    assert not site.ask("cancel").accepted
    assert not site.ask("commit").accepted


@pytest.mark.parametrize("error", [CalibrationError("face -z is missing"), np.linalg.LinAlgError("singular")])
def test_a_fit_that_fails_rejects_the_session_with_its_reason(site, error):
    site.script.error = error
    site.begin()
    site.pose()
    site.pose()
    assert (site.session.phase, site.session.text) == ("rejected", str(error))
    assert site.store.ids() == []


def test_commit_needs_a_review_and_the_record_that_was_reviewed(site):
    assert "no record is in review" in site.ask("commit").text
    site.begin()
    assert "still collecting" in site.ask("commit").text
    site.pose()
    site.pose()
    answer = site.ask("commit", record="another-one")
    assert f"record {site.session.record_id} is in review, not another-one" in answer.text
    assert site.in_force is None


def test_limits_that_are_not_met_are_no_matter_of_reasons(site):
    site.script.judgement = Acceptance(refused=("residual too large",))
    site.review()
    answer = site.ask("commit", reason="because")
    assert (answer.accepted, answer.text) == (False, "residual too large")
    assert site.session.phase == "review"
    assert site.in_force is None


def test_implausible_drift_asks_for_a_reason(site):
    site.script.judgement = Acceptance(implausible=("offset x moved by 60 mg",))
    site.review()
    assert "give a reason" in site.ask("commit", reason="  ").text
    assert site.in_force is None
    assert site.ask("commit", reason="sensor was exchanged").accepted


def test_rollback_goes_to_the_parent_and_a_named_record_comes_back(site):
    first, second, third = site.commit(1.0), site.commit(2.0), site.commit(3.0)
    assert site.ask("rollback").accepted
    assert site.in_force == second
    assert site.ask("rollback", by="bob", to=third).accepted
    assert site.in_force == third
    assert not site.ask("rollback", to=third).accepted  # it is in force already
    assert not site.ask("rollback", to="no-such-record").accepted
    assert [site.ask("rollback").accepted for _ in range(3)] == [True, True, True]
    assert site.in_force is None
    assert "no record is in force" in site.ask("rollback").text
    assert site.store.ids() == sorted([first, second, third])


def test_the_first_record_goes_back_to_the_factorys(site, record):
    factory = record(id="factory-7")
    site.start(factory_calibration=factory)
    site.commit(1.0)
    assert site.store.in_force().parent == "factory-7"
    answer = site.ask("rollback")
    assert answer.accepted
    assert "factory" in answer.text
    assert site.in_force is None


def test_zero_needs_a_record_and_a_load_that_hangs_still(site):
    assert "no calibration is in force" in site.ask("zero").text
    parent = site.commit(1.0)
    assert "static for 0 s" in site.ask("zero").text
    site.hang_still()
    answer = site.ask("zero", by="bob")
    assert answer.accepted, answer.text
    zeroed = site.store.in_force()
    assert (zeroed.method, zeroed.parent, zeroed.by) == ("zero", parent, "bob")
    assert site.session.phase == "committed"
    site.hang_still()
    site.script.judgement = Acceptance(implausible=("turned by 4 deg",))
    assert "give a reason" in site.ask("zero").text
    assert site.ask("zero", reason="new clamp").accepted


def test_movement_ends_the_stillness_that_zero_needs(site):
    site.commit(1.0)
    site.hang_still()
    site.recalibration.watch.verdict("swinging", site.now_ns)
    site.hang_still(20)
    assert "static for" in site.ask("zero").text


def test_every_attempt_is_written_down_with_who_asked(site):
    site.ask("commit", by="eve")
    site.begin()
    site.ask("recalibrate", by="bob")
    site.recalibration.answer("commit", b"no json", site.moment)
    asked = [entry for entry in site.audit() if entry["event"] == "request"]
    assert [(entry["verb"], entry.get("by"), entry["accepted"]) for entry in asked] == [
        ("commit", "eve", False),
        ("recalibrate", "ann", True),
        ("recalibrate", "bob", False),
        ("commit", None, False),
    ]
    assert all(entry["why"] for entry in asked if not entry["accepted"])
    assert len([line for line in site.told if '"event": "request"' in line]) == len(asked)


def test_what_is_stored_and_what_is_in_review_can_be_fetched(site):
    first = site.commit(1.0)
    site.review(2.0)
    listed = site.ask_raw("fetch", {}).content
    assert (listed["in_force"], listed["review"]) == (first, site.session.record_id)
    assert [(entry["id"], entry["method"]) for entry in listed["records"]] == [(first, "six-position")]
    for record_id, offset in ((first, 1.0), (listed["review"], 2.0)):
        answer = site.ask_raw("fetch", {"what": "record", "record": record_id})
        assert answer.content["record"]["offset"][0] == offset
    assert not site.ask_raw("fetch", {"what": "record", "record": "no-such-record"}).accepted
    (site.store.folder / "records" / f"{first}.json").write_text("{")
    (entry,) = site.ask_raw("fetch", {}).content["records"]
    assert "cannot be read" in entry["error"] or "Field required" in entry["error"]
