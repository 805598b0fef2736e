"""The fixture of a recalibration whose fits are scripted."""

from pathlib import Path

import pytest

from gateway.calibration import pose_procedure
from gateway.calibration.methods import zeroing
from gateway.recalibration import commands, recalibration
from tests.gateway.recalibration.scripted_site import Script, Site


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Site:
    script = Script()
    monkeypatch.setattr(pose_procedure, "make_procedure", script.make_procedure)
    monkeypatch.setattr(zeroing, "zero_in_place", script.zero_in_place)
    for module in (recalibration, commands):
        monkeypatch.setattr(module, "judge", script.judge)
    return Site(tmp_path, script)
