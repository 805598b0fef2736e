"""The session from the request to the record: its transitions, its ends, and refused requests."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gateway.calibration.acceptance import Acceptance
from gateway.calibration.record import CalibrationError
from gateway.recalibration.session import MAX_IDLE_S, MAX_REVIEW_S, MAX_SESSION_S
from tests.gateway.conftest import record_content
from tests.gateway.recalibration.scripted_site import Site
from tests.values import present

MakeContent = Callable[..., dict[str, Any]]


def test_a_session_leads_from_the_request_to_a_record_in_force(site: Site) -> None:
    assert site.recalibration.session is None
    site.start_session("session-1")
    assert site.phase() == "collecting"
    assert "SUSPENDED" in site.suspension
    site.take_pose()
    assert len(site.session.poses) == 1
    site.take_pose()
    assert site.phase() == "review"
    assert site.suspension
    assert site.in_force() is None
    answer = site.ask("commit", by="bob", reason="new clamp", record=site.session.record_id)
    assert answer.accepted
    assert site.phase() == "committed"
    assert site.suspension == ""
    assert site.pipeline_changed
    record = site.record_in_force()
    assert record.id == answer.content["record"]
    assert (record.by, record.parent, record.device_id) == ("ann", None, "part-7")
    (change,) = site.store.state().history
    assert (change.by, change.reason) == ("bob", "new clamp")


@pytest.mark.slow
def test_the_parent_of_a_second_record_is_the_first_which_stays(site: Site) -> None:
    first = site.commit(1.0)
    second = site.commit(2.0)
    assert site.record_in_force().parent == first
    assert site.store.ids() == sorted([first, second])


def test_only_one_session_can_be_active(site: Site) -> None:
    site.start_session()
    for verb in ("recalibrate", "zero", "rollback"):
        answer = site.ask(verb, by="bob")
        assert not answer.accepted
        assert "a session is active (six-position, started by ann)" in answer.text


@pytest.mark.parametrize(
    ("poses", "wait_s", "text"),
    [(0, MAX_IDLE_S, "no pose"), (1, MAX_IDLE_S, "no pose"), (2, MAX_REVIEW_S, "not committed")],
)
def test_an_abandoned_session_ends(site: Site, poses: int, wait_s: float, text: str) -> None:
    site.start_session()
    for _ in range(poses):
        site.take_pose()
    site.wait(wait_s - 1)
    assert site.session.is_active
    site.wait(2)
    assert site.phase() == "rejected"
    assert text in site.session.text
    assert site.in_force() is None


@pytest.mark.parametrize("restarted", [False, True])
def test_alerts_stay_suspended_after_an_abandoned_session_until_the_housing_is_confirmed(
    site: Site, restarted: bool
) -> None:
    site.start_session()
    site.wait(MAX_IDLE_S + 1)
    if restarted:
        site.restart()
    assert "has ended" in site.suspension
    assert site.ask("cancel", by="bob").accepted
    assert site.suspension == ""
    assert site.pipeline_changed
    assert site.phase() == "rejected"
    assert not site.ask("cancel").accepted
    site.start_session()
    assert site.ask("cancel").accepted
    assert site.suspension == ""


def test_a_session_has_a_longest_duration(site: Site) -> None:
    site.start_session()
    site.take_pose()
    for _ in range(int(MAX_SESSION_S / MAX_IDLE_S) + 1):
        session = site.session
        site.recalibration.session = session.model_copy(update={"touched_ns": site.now_ns})
        site.wait(MAX_IDLE_S - 1)
    assert site.phase() == "rejected"
    assert "lasted longer" in site.session.text


def test_a_cancelled_session_keeps_the_old_record(site: Site) -> None:
    before = site.commit(1.0)
    site.review(2.0)
    answer = site.ask("cancel", by="bob")
    assert answer.accepted
    assert (site.phase(), site.session.text) == ("rejected", "cancelled by bob")
    assert site.suspension == ""
    assert site.in_force() == before
    assert not site.ask("cancel").accepted
    assert not site.ask("commit").accepted


@pytest.mark.parametrize("error", [CalibrationError("face -z is missing"), np.linalg.LinAlgError("singular")])
def test_a_failed_fit_rejects_the_session_with_its_reason(site: Site, error: Exception) -> None:
    site.script.error = error
    site.start_session()
    site.take_pose()
    site.take_pose()
    assert (site.phase(), site.session.text) == ("rejected", str(error))
    assert site.store.ids() == []


def test_a_commit_requires_a_review_and_the_reviewed_record(site: Site) -> None:
    assert "no record is in review" in site.ask("commit").text
    site.start_session()
    assert "still collecting" in site.ask("commit").text
    site.take_pose()
    site.take_pose()
    answer = site.ask("commit", record="another-one")
    assert f"record {site.session.record_id} is in review, not another-one" in answer.text
    assert site.in_force() is None


def test_a_record_beyond_the_limits_is_refused_whatever_the_reason(site: Site) -> None:
    site.script.acceptance = Acceptance(refused=("residual too large",))
    site.review()
    answer = site.ask("commit", reason="because")
    assert (answer.accepted, answer.text) == (False, "residual too large")
    assert site.phase() == "review"
    assert site.in_force() is None


def test_an_implausible_drift_requires_a_reason(site: Site) -> None:
    site.script.acceptance = Acceptance(implausible=("offset x moved by 60 mg",))
    site.review()
    assert "give a reason" in site.ask("commit", reason="  ").text
    assert site.in_force() is None
    assert site.ask("commit", reason="sensor was exchanged").accepted


@pytest.mark.slow
def test_a_rollback_returns_to_the_parent_or_to_a_named_record(site: Site) -> None:
    first, second, third = site.commit(1.0), site.commit(2.0), site.commit(3.0)
    assert site.ask("rollback").accepted
    assert site.in_force() == second
    assert site.ask("rollback", by="bob", to=third).accepted
    assert site.in_force() == third
    assert not site.ask("rollback", to=third).accepted  # already in force
    assert not site.ask("rollback", to="no-such-record").accepted
    assert [site.ask("rollback").accepted for _ in range(3)] == [True, True, True]
    assert site.in_force() is None
    assert "no record is in force" in site.ask("rollback").text
    assert site.store.ids() == sorted([first, second, third])


def test_a_rollback_of_the_first_record_returns_to_the_factory_record(site: Site) -> None:
    factory = record_content(id="factory-7")
    site.restart(factory_calibration=factory)
    site.commit(1.0)
    assert site.record_in_force().parent == "factory-7"
    answer = site.ask("rollback")
    assert answer.accepted
    assert answer.text == "the device's factory record factory-7 is in force again"
    assert site.in_force() is None
    assert site.ask("rollback", to="factory-7").text == "record factory-7 is in force already"
    site.commit(2.0)
    assert site.ask("rollback", to="factory-7").accepted
    assert site.in_force() is None


def test_what_a_session_says_of_its_record_stays_true_after_a_rollback(site: Site) -> None:
    first, second = site.commit(1.0), site.commit(2.0)

    def said() -> str:
        return present(site.recalibration.session).text

    assert said() == f"record {second} was put in force"
    assert site.ask("rollback", reason="wrong face").text == f"record {first} is in force again"
    assert said() == f"record {second} was put in force, and withdrawn by ann: wrong face"
    assert site.ask("rollback", by="bob").text == "no record is in force: the device has none of its factory"
    assert said() == f"record {second} was put in force, and withdrawn by ann: wrong face"
    assert site.ask("rollback", to=second).accepted
    assert said() == f"record {second} was put in force"


def test_zeroing_requires_a_record_and_a_load_that_hangs_still(site: Site) -> None:
    assert "no calibration is in force" in site.ask("zero").text
    parent = site.commit(1.0)
    assert "static for 0 s" in site.ask("zero").text
    site.hang_still()
    answer = site.ask("zero", by="bob")
    assert answer.accepted, answer.text
    zeroed = site.record_in_force()
    assert (zeroed.method, zeroed.parent, zeroed.by) == ("zero", parent, "bob")
    assert site.phase() == "committed"
    site.hang_still()
    site.script.acceptance = Acceptance(implausible=("turned by 4 deg",))
    assert "give a reason" in site.ask("zero").text
    assert site.ask("zero", reason="new clamp").accepted


def test_a_movement_restarts_the_stillness_that_zeroing_requires(site: Site) -> None:
    site.commit(1.0)
    site.hang_still()
    site.recalibration.interlock.add_verdict("swinging", site.now_ns)
    site.hang_still(20)
    assert "static for" in site.ask("zero").text


def test_every_request_is_audited_with_its_person(site: Site) -> None:
    site.ask("commit", by="eve")
    site.start_session()
    site.ask("recalibrate", by="bob")
    asked = [entry for entry in site.audit() if entry["event"] == "request"]
    assert [(entry["verb"], entry.get("by"), entry["accepted"]) for entry in asked] == [
        ("commit", "eve", False),
        ("recalibrate", "ann", True),
        ("recalibrate", "bob", False),
    ]
    assert all(entry["why"] for entry in asked if not entry["accepted"])
    assert len([line for line in site.log_lines if '"event": "request"' in line]) == len(asked)


def test_stored_records_and_the_record_in_review_can_be_fetched(site: Site) -> None:
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


def test_a_record_made_offline_is_put_in_force_by_a_request_that_is_audited(site: Site) -> None:
    """A file in the store is unused until a person names it; one of another part, or a changed one, is refused."""
    folder = site.store.folder / "records"
    folder.mkdir(parents=True, exist_ok=True)
    made, other = record_content(id="ramps-1", method="thermal"), record_content(id="ramps-2", device_id="part-8")
    for content in (made, other, made | {"id": "ramps-3"}):
        (folder / f"{content['id']}.json").write_text(json.dumps(content))
    assert site.in_force() is None
    for name, why in {"ramps-2": "part-8", "ramps-3": "sha256"}.items():
        refused = site.ask("rollback", to=name)
        assert not refused.accepted
        assert why in refused.text
    assert site.ask("rollback", by="bob", reason="ramps on the bench", to="ramps-1").accepted
    assert site.record_in_force().method == "thermal"
    (change,) = site.store.state().history
    assert (change.by, change.reason) == ("bob", "ramps on the bench")
    asked = [(entry["by"], entry["accepted"]) for entry in site.audit() if entry["event"] == "request"]
    assert asked == [("ann", False), ("ann", False), ("bob", True)]
