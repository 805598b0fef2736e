"""Models as data: read, refused with the place and the correction, written back."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from gateway.errors import InputError
from gateway.measurement.rig_file import read_rig
from gateway.pipeline.rig import Rig
from gateway.twin.model import EffectValues, as_tables, model_of, parse_effect_assignments, validate_effects
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.swings import RIG

BELIEFS = """[rope]
length_m = 12.0
[housing]
position_m = 5.0
[sensor]
sample_rate_hz = 50
noise_g = 0.0005
"""


def rig_of(tmp_path: Path, model: str = "") -> Rig:
    path = tmp_path / "rig.toml"
    path.write_text(BELIEFS + model)
    return read_rig(path)


def test_effects_of_a_rig_are_written_as_they_were_read(tmp_path: Path) -> None:
    text = "[model.viscous_damping]\ndamping_ratio = 0.004\n[model.steady_wind]\naccel_m_s2 = [0.1, -0.2]\n"
    model = model_of(rig_of(tmp_path, text))
    assert model.rig.noise_g == (0.0005, 0.0005, 0.0005)
    assert model.effects == {"viscous_damping": {"damping_ratio": 0.004}, "steady_wind": {"accel_m_s2": (0.1, -0.2)}}
    assert tomllib.loads(tomli_w.dumps({"model": as_tables(model.effects)})) == tomllib.loads(text)


def test_housing_above_the_load_gets_its_distance_from_the_pivot(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("[rope]\nlength_m = 12\n[housing]\nabove_load_m = 3\n")
    assert model_of(read_rig(path)).rig.position_m == 9.0


@pytest.mark.parametrize(("position_m", "length_u_rel"), [(25.2, 0.2), (14.8, 0.02)])
def test_a_housing_below_its_load_is_refused(tmp_path: Path, position_m: float, length_u_rel: float) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(f"[rope]\nlength_m = 14\nlength_u_rel = {length_u_rel}\n[housing]\nposition_m = {position_m}\n")
    with pytest.raises(
        InputError, match=rf"housing.position_m {position_m} is below the load: rope.length_m is 14, at most"
    ):
        read_rig(path)


@pytest.mark.parametrize(
    ("housing", "from_load"),
    [({"above_load_m": 3.0}, True), ({"position_m": 12.0}, True), ({"position_m": 11.9}, False)],
)
def test_a_place_stated_from_the_load_or_at_the_ropes_end_moves_with_its_length(
    housing: dict[str, float], from_load: bool
) -> None:
    rig = Rig.model_validate({"rope": {"length_m": 12.0}, "housing": housing})
    assert model_of(rig).rig.is_placed_from_load is from_load


@pytest.mark.parametrize(
    ("tables", "text"),
    [
        ({"viscosity": {}}, r"rig: \[model.viscosity\] is no effect; known are axis_offset, .*vibration"),
        ({"impact": {"start_s": 1.0}}, r"\[model.impact\] needs delta_v_m_s, in m/s: jump of velocity"),
        ({"quadratic_drag": {"drag": 1.0}}, r"\[model.quadratic_drag\] has no drag; its parameters are drag_per_m"),
        ({"viscous_damping": {"damping_ratio": -0.1}}, r"damping_ratio = -0.1 should be from 0 to 0.5$"),
        ({"viscous_damping": {"damping_ratio": float("nan")}}, "should be from 0 to 0.5"),
        ({"viscous_damping": {"damping_ratio": "much"}}, "damping_ratio = much should be"),
        ({"viscous_damping": {"damping_ratio": [0.1, 0.2]}}, "should be one number"),
        ({"steady_wind": {"accel_m_s2": 0.1}}, r"accel_m_s2 = 0.1 should be \[x, y\]"),
    ],
)
def test_wrong_model_is_refused_with_the_correction(tables: dict[str, dict[str, Any]], text: str) -> None:
    with pytest.raises(InputError, match=text):
        validate_effects(tables, "rig")


def test_effects_of_the_command_line_take_typical_values() -> None:
    found = parse_effect_assignments({}, ["viscous_damping", "wind_gust:accel_m_s2=0.3,-0.1:start_s=40"])
    assert found["viscous_damping"] == {"damping_ratio": 5e-3}
    assert found["wind_gust"] == {"accel_m_s2": (0.3, -0.1), "start_s": 40.0, "duration_s": 5.0, "rising_share": 1.0}
    for wrong in ("wind_gust:start_s=soon", "wind_gust:start_s", "storm", "wind_gust:speed=3"):
        with pytest.raises(InputError, match="--effect"):
            parse_effect_assignments({}, [wrong])


def test_parameter_vector_and_effects_convert_into_each_other() -> None:
    effects: EffectValues = {
        "axis_offset": {"offset_g": (0.01, 0.02, 0.03)},
        "impact": {"delta_v_m_s": (0.1, 0.2), "start_s": 7.0},
    }
    simulator = Simulator(RIG, ("impact", "axis_offset"))
    values = simulator.values([0.1, 0.2, 0.3, 0.4, 0.5], effects)
    assert simulator.effects(values) == effects
    assert [slot.label for slot in simulator.parameters][:6] == [
        "initial.tilt_x_rad",
        "initial.tilt_y_rad",
        "initial.rate_x_rad_s",
        "initial.rate_y_rad_s",
        "initial.heading_rad",
        "impact.delta_v_m_s[x]",
    ]
    assert np.array_equal(values[:5], [0.1, 0.2, 0.3, 0.4, 0.5])
    assert [slot.refitted for slot in simulator.parameters] == [True] * 5 + [False] * 6
