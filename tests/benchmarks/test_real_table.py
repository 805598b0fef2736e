"""The table of real recordings judges an answer by what is known of the part that it is about."""

from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks.real_angles import known_angles
from tests.benchmarks.real_manifest import RealRecording, read_manifest
from tests.benchmarks.real_table import Row, counts, measure_cells


def recording(**changed: object) -> RealRecording:
    given = {"name": "a", "path": "work/a.csv", "source": "", "licence": "", "sha256": "", "rig": "", "known_from": ""}
    return RealRecording(**{"known_deg": (60.0, 0.5), "plausible": ["viscous_damping"], **given, **changed})  # type: ignore[arg-type]


def measured(low_deg: float, high_deg: float, from_s: float) -> dict[str, object]:
    swing = {"phi_max_deg": (low_deg + high_deg) / 2, "coverage95_deg": [low_deg, high_deg]}
    return {"swing": swing, "free_swing": {"from_s": from_s, "to_s": 10.0}, "wall_s": 1.0}


DECAY = np.linspace(0.0, 10.0, 101), np.radians(np.linspace(60.0, 20.0, 101))
"""4° less each second."""


def test_interval_is_compared_with_the_angle_of_the_part_that_is_judged() -> None:
    held = {"measure": measured(38.5, 40.5, 5.0)}
    assert Row(recording(), DECAY, held).holds
    assert not Row(recording(), DECAY, {"measure": measured(58.0, 62.0, 5.0)}).holds
    assert measure_cells(Row(recording(), DECAY, held))[1] == "40.0 ± 1 of the part judged, 60 of all"


def test_unknown_angle_is_printed_with_its_reason() -> None:
    answers = {"measure": {"swing": {}, "swing_reasons": ["less than a swing"], "wall_s": 1.0}}
    assert measure_cells(Row(recording(), None, answers))[2] == "unknown: less than a swing"


def test_effect_that_no_engineer_would_sign_is_counted_as_implausible() -> None:
    named = [{"name": name, "parameters": dict[str, float]()} for name in ("viscous_damping", "clipping")]
    row = Row(recording(), None, {"reconcile": {"verdict": "named", "effects": named, "wall_s": 1.0}})
    assert row.strange_names == ["clipping"]
    assert "effects named in 1, all of them plausible in 0" in counts([row])


def test_quaternion_gives_the_tilt_and_not_the_turn_about_the_vertical(tmp_path: Path) -> None:
    half = np.radians(30.0) / 2
    rows = [
        (0.0, 1.0, 0.0, 0.0, 0.0),
        (1.0, np.cos(half), np.sin(half), 0.0, 0.0),
        (2.0, np.cos(half), 0.0, 0.0, np.sin(half)),
    ]
    path = tmp_path / "capture.csv"
    path.write_text("".join(";".join(map(str, row)) + "\n" for row in rows))
    angles = known_angles(recording(attitude={"time_column": 0, "column": 1, "axis": 0}), path)
    assert angles is not None
    assert np.degrees(angles[1]) == pytest.approx([0.0, 0.0, 30.0], abs=1e-6)


def test_each_recording_states_where_it_comes_from_and_what_is_known() -> None:
    entries = read_manifest()
    assert len({entry.name for entry in entries}) == len(entries)
    assert all(len(entry.sha256) == 64 and entry.licence and entry.known_from for entry in entries)
    assert all(entry.plausible or entry.refused_because for entry in entries)
