"""The certificates beside a report are made from the records: what a recording of unknown origin has as a page is not written."""

from gateway.incident.evidence import make_certificates
from tests.gateway.calibration.test_acceptance import make_parent
from tests.gateway.certificate.conftest import sealed

HOSTILE = b"<script>alert(1)</script>"


def test_a_certificate_is_made_from_its_record_and_not_taken_from_the_recording() -> None:
    record = sealed({**make_parent().model_dump(mode="json"), "by": HOSTILE.decode()})
    name = f"calibration-{record.id}"
    made = make_certificates({f"{name}.json": record.model_dump_json().encode(), f"{name}.html": HOSTILE})
    assert list(made) == [f"{name}.html"]
    assert b"Calibration certificate" in made[f"{name}.html"]
    assert HOSTILE not in made[f"{name}.html"]


def test_a_certificate_without_a_valid_record_is_left_out() -> None:
    assert (
        make_certificates({"calibration-a.html": HOSTILE, "calibration-a.json": b"{}", "calibration-b.html": HOSTILE})
        == {}
    )
