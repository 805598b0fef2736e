"""The store: which record is in force for which device, over changes, restarts and damaged files."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import CalibrationStore, find_record_in_force
from tests.gateway.conftest import record_content

WHO = {"by": "ann", "reason": "bench", "time_utc": "2026-01-02T00:00:00Z"}

MakeRecord = Callable[..., CalibrationRecord]


@pytest.fixture
def store(tmp_path: Path) -> CalibrationStore:
    return CalibrationStore(tmp_path, "part-7")


@pytest.fixture
def make() -> MakeRecord:
    """Make a record with an id; keywords change its fields."""

    def make_record(record_id: str, **changes: Any) -> CalibrationRecord:
        return CalibrationRecord.model_validate(record_content(id=record_id, **changes))

    return make_record


def add_and_put_in_force(store: CalibrationStore, record: CalibrationRecord, request: str = "q") -> None:
    store.add(record)
    store.put_in_force(record.id, request=request, **WHO)


def test_no_record_is_in_force_until_one_is_put_in_force(
    store: CalibrationStore, make: MakeRecord, tmp_path: Path
) -> None:
    assert store.in_force() is None
    store.add(make("r1"))
    assert store.in_force() is None
    assert find_record_in_force(tmp_path, "part-7") is None


def test_the_record_in_force_is_found_by_identity_after_a_restart(
    store: CalibrationStore, make: MakeRecord, tmp_path: Path
) -> None:
    add_and_put_in_force(store, make("r1"))
    assert find_record_in_force(tmp_path, "part-7") == make("r1")
    assert find_record_in_force(tmp_path, "part-8") is None


def test_the_history_has_an_entry_for_each_change_and_the_old_record_stays(
    store: CalibrationStore, make: MakeRecord
) -> None:
    add_and_put_in_force(store, make("r1"), "first")
    add_and_put_in_force(store, make("r2", parent="r1"), "second")
    store.put_in_force("r1", request="back", **WHO)
    store.put_in_force(None, request="none", **WHO)
    history = store.state().history
    assert [(change.request, change.before, change.after) for change in history] == [
        ("first", None, "r1"),
        ("second", "r1", "r2"),
        ("back", "r2", "r1"),
        ("none", "r1", None),
    ]
    assert {change.by for change in history} == {"ann"}
    assert store.in_force() is None
    assert store.ids() == ["r1", "r2"]


def test_a_record_is_offered_from_its_arrival_until_it_or_another_one_is_in_force(
    store: CalibrationStore, make: MakeRecord
) -> None:
    store.add(make("r2", parent="r1"))
    assert store.offer() is None  # of a parent that is not in force
    add_and_put_in_force(store, make("r1"))
    store.add(make("r0", parent="r1"))  # made before the record in force
    store.add(make("r3"))
    assert store.offer() == make("r2", parent="r1")
    store.put_in_force("r2", request="taken", **WHO)
    assert store.offer() is None
    store.put_in_force("r1", request="taken back", **WHO)
    assert store.offer() is None


def test_a_stored_record_is_never_changed(store: CalibrationStore, make: MakeRecord) -> None:
    add_and_put_in_force(store, make("r1"))
    store.add(make("r1"))  # the same record again
    with pytest.raises(CalibrationError, match="never changed"):
        store.add(make("r1", by="somebody else"))
    assert store.in_force() == make("r1")


def test_a_record_of_another_device_is_refused(store: CalibrationStore, make: MakeRecord) -> None:
    with pytest.raises(CalibrationError, match="belongs to part-8, not to part-7"):
        store.add(make("r1", device_id="part-8"))
    path = store.folder / "records" / "r1.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(make("r1", device_id="part-8").model_dump(mode="json")))
    with pytest.raises(CalibrationError, match="belongs to part-8, not to part-7"):
        store.put_in_force("r1", request="q", **WHO)
    assert store.in_force() is None


def test_devices_with_similar_names_have_different_folders(tmp_path: Path) -> None:
    names = ["a/b", "a_b", "a%2Fb", "..", ".", "a b"]
    folders = {CalibrationStore(tmp_path, name).folder for name in names}
    assert len(folders) == len(names)
    assert {folder.parent for folder in folders} == {tmp_path / "calibration"}


@pytest.mark.parametrize("record_id", ["../r1", "", ".r1", "a/b", "x" * 200])
def test_an_id_that_is_a_path_is_refused(store: CalibrationStore, record_id: str) -> None:
    with pytest.raises(CalibrationError, match="is no id of a record"):
        store.record(record_id)


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:40])


def name_another_record(path: Path) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | {"in_force": "r1"}))


def name_another_device(path: Path) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | {"device_id": "part-8"}))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (truncate, "cannot be read"),
        (name_another_record, "not the one of the last change"),
        (name_another_device, "belongs to part-8"),
    ],
)
def test_a_damaged_state_never_puts_another_record_in_force(
    store: CalibrationStore, make: MakeRecord, damage: Callable[[Path], None], text: str
) -> None:
    add_and_put_in_force(store, make("r1"))
    add_and_put_in_force(store, make("r2", parent="r1"))
    damage(store.folder / "in_force.json")
    with pytest.raises(CalibrationError, match=text) as caught:
        store.in_force()
    assert "in_force.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_record_can_be_put_in_force_over_a_damaged_state_which_is_kept(
    store: CalibrationStore, make: MakeRecord
) -> None:
    add_and_put_in_force(store, make("r1"))
    truncate(store.folder / "in_force.json")
    damaged = (store.folder / "in_force.json").read_bytes()
    store.put_in_force("r1", request="repair", **WHO)
    assert store.in_force() == make("r1")
    assert (store.folder / "in_force.unreadable.json").read_bytes() == damaged


@pytest.mark.parametrize("change", [lambda text: text[:300], lambda text: text.replace("-20.0", "-21.0")])
def test_a_damaged_record_is_never_replaced_by_another_record(
    store: CalibrationStore, make: MakeRecord, change: Callable[[str], str]
) -> None:
    add_and_put_in_force(store, make("r1"))
    add_and_put_in_force(store, make("r2", parent="r1"))
    path = store.folder / "records" / "r2.json"
    path.write_text(change(path.read_text()))
    with pytest.raises(CalibrationError, match=r"r2\.json"):
        store.in_force()


def test_a_missing_record_is_reported_by_name(store: CalibrationStore, make: MakeRecord) -> None:
    add_and_put_in_force(store, make("r1"))
    (store.folder / "records" / "r1.json").unlink()
    with pytest.raises(CalibrationError, match=r"r1\.json: there is no such record"):
        store.in_force()
