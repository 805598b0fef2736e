"""The files of every kind."""

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.working_crane.real.__main__ import main
from tests.working_crane.real.kinds import KINDS
from tests.working_crane.real.recording import make
from tests.working_crane.real.write import COLUMNS

pytestmark = pytest.mark.slow

NUMBERS = {"a": (0, 1), "b": (0, 1, 2), "c": (0, 7, 2), "d": (3, 1, 2), "e": (0,), "f": (0, 1, 2), "g": (0, 1, 2, 3)}
NUMBERS |= {"h": (40, 9, 2, 3), "i": (0, 1, 2)}
"""One of each variant. They have an angle in range at the first draw; the first of kind g is drawn again."""
DURATION_S = {"h": 60.0}
"""Of a recording; 40 s of the others, which show a drive."""


def test_same_seed_writes_the_same_files_with_the_columns_that_are_scored(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        main(
            [
                str(tmp_path / folder),
                *["--seed", "3", "--count", "1", "--kind", "e", "--duration", "30", "--rate", "50"],
            ]
        )
    first, second = tmp_path / "a/work_e00", tmp_path / "b/work_e00"
    names = sorted(path.name for path in first.iterdir())
    assert names == ["case.json", "gateway.toml", "log.csv", "rig.toml", "truth.csv"]
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes()
    with (first / "truth.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(COLUMNS)
    assert len(rows) == 30 * 50
    facts = json.loads((first / "case.json").read_text())
    assert {"kind", "what", "variant", "length_m", "rho", "noise_g", "fs_hz", "largest_deg", "events"} <= facts.keys()
    stated = tomllib.loads((first / "gateway.toml").read_text())
    assert stated["rope"]["length_m"] == pytest.approx(10.0, rel=0.2)
    rig = tomllib.loads((first / "rig.toml").read_text())
    assert rig["housing"]["position_m"] == pytest.approx(
        stated["rope"]["length_m"] - stated["housing"]["above_load_m"], abs=0.011
    )


def test_radio_loses_samples_in_bursts_and_stamps_them_late() -> None:
    recording = make("g", 5, 3, 40.0, 50.0)
    assert 0.01 < 1 - len(recording.log_time_s) / 2000 < 0.12
    assert np.all(np.diff(recording.log_time_s) > 0)
    assert np.diff(recording.log_time_s).max() > 0.05
    assert np.isfinite(recording.reading_g).all()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_variant_is_recorded_with_angles_worth_watching(kind: str) -> None:
    for number in NUMBERS[kind]:
        recording = make(kind, 17, number, DURATION_S.get(kind, 40.0), 50.0)
        truth = recording.truth
        assert np.isfinite(recording.reading_g).all()
        assert all(np.isfinite(column).all() for column in truth.values())
        assert 1.0 < truth["angle_deg"].max() < 20.0
        assert truth["angle_deg"][0] < 6.0
        assert np.linalg.norm(np.median(recording.reading_g, axis=0)) == pytest.approx(1.0, abs=0.02)
        assert truth["driven"].any()
