"""Which record is in force for which device, over changes, restarts and spoilt files."""

import json

import pytest

from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import CalibrationStore, find

WHO = {"by": "ann", "reason": "bench", "time_utc": "2026-01-02T00:00:00Z"}


@pytest.fixture
def store(tmp_path):
    return CalibrationStore(tmp_path, "part-7")


@pytest.fixture
def made(record):
    def make(record_id, **changes):
        return CalibrationRecord.model_validate(record(id=record_id, **changes))

    return make


def put(store, record, request="q"):
    store.add(record)
    store.put_in_force(record.id, request=request, **WHO)


def test_nothing_is_in_force_before_anything_was_put_in_force(store, made, tmp_path):
    assert store.in_force() is None
    store.add(made("r1"))
    assert store.in_force() is None
    assert find(tmp_path, "part-7") is None


def test_a_record_in_force_is_found_by_identity_after_a_restart(store, made, tmp_path):
    put(store, made("r1"))
    found = find(tmp_path, "part-7")
    assert found == made("r1")
    assert find(tmp_path, "part-8") is None


def test_every_change_has_its_line_and_the_old_record_stays(store, made):
    put(store, made("r1"), "first")
    put(store, made("r2", parent="r1"), "second")
    store.put_in_force("r1", request="back", **WHO)
    store.put_in_force(None, request="none", **WHO)
    history = store.state().history
    assert [(line.request, line.before, line.after) for line in history] == [
        ("first", None, "r1"),
        ("second", "r1", "r2"),
        ("back", "r2", "r1"),
        ("none", "r1", None),
    ]
    assert {line.by for line in history} == {"ann"}
    assert store.in_force() is None
    assert store.ids() == ["r1", "r2"]


def test_records_are_never_changed(store, made):
    put(store, made("r1"))
    store.add(made("r1"))  # the same again
    with pytest.raises(CalibrationError, match="never changed"):
        store.add(made("r1", by="somebody else"))
    assert store.in_force() == made("r1")


def test_another_devices_record_is_not_taken(store, made):
    with pytest.raises(CalibrationError, match="belongs to part-8, not to part-7"):
        store.add(made("r1", device_id="part-8"))
    path = store.folder / "records" / "r1.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(made("r1", device_id="part-8").model_dump(mode="json")))
    with pytest.raises(CalibrationError, match="belongs to part-8, not to part-7"):
        store.put_in_force("r1", request="q", **WHO)
    assert store.in_force() is None


def test_devices_whose_names_are_alike_have_folders_of_their_own(tmp_path):
    names = ["a/b", "a_b", "a%2Fb", "..", ".", "a b"]
    folders = {CalibrationStore(tmp_path, name).folder for name in names}
    assert len(folders) == len(names)
    assert {folder.parent for folder in folders} == {tmp_path / "calibration"}


@pytest.mark.parametrize("record_id", ["../r1", "", ".r1", "a/b", "x" * 200])
def test_an_id_is_no_path(store, record_id):
    with pytest.raises(CalibrationError, match="is no id of a record"):
        store.record(record_id)


def torn(path):
    path.write_bytes(path.read_bytes()[:40])


def other_record_in_force(path):
    content = json.loads(path.read_text()) | {"in_force": "r1"}
    path.write_text(json.dumps(content))


def other_device(path):
    content = json.loads(path.read_text()) | {"device_id": "part-8"}
    path.write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (torn, "cannot be read"),
        (other_record_in_force, "not the one that the last change named"),
        (other_device, "belongs to part-8"),
    ],
)
def test_a_spoilt_state_is_never_another_record(store, made, spoil, said):
    put(store, made("r1"))
    put(store, made("r2", parent="r1"))
    spoil(store.folder / "in_force.json")
    with pytest.raises(CalibrationError, match=said) as caught:
        store.in_force()
    assert "in_force.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_person_puts_a_record_in_force_over_a_spoilt_state_which_is_kept(store, made):
    put(store, made("r1"))
    torn(store.folder / "in_force.json")
    spoilt = (store.folder / "in_force.json").read_bytes()
    store.put_in_force("r1", request="mend", **WHO)
    assert store.in_force() == made("r1")
    assert (store.folder / "in_force.unreadable.json").read_bytes() == spoilt


@pytest.mark.parametrize("change", [lambda text: text[:300], lambda text: text.replace("-20.0", "-21.0")])
def test_a_spoilt_record_is_never_another_record(store, made, change):
    put(store, made("r1"))
    put(store, made("r2", parent="r1"))
    path = store.folder / "records" / "r2.json"
    path.write_text(change(path.read_text()))
    with pytest.raises(CalibrationError, match=r"r2\.json"):
        store.in_force()


def test_a_record_that_is_gone_is_named(store, made):
    put(store, made("r1"))
    (store.folder / "records" / "r1.json").unlink()
    with pytest.raises(CalibrationError, match=r"r1\.json: there is no such record"):
        store.in_force()
