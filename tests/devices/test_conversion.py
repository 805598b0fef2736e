"""Conversion of outputs to specific force: the worked examples and Tables 3 and 4 of Sawicki and Walendziuk 2016."""

import json
from pathlib import Path

import numpy as np
import pytest

from devices.conversion import force_g, sensitivity, sensor_output, squared_magnitude, zero_g_output

TABLES = json.loads((Path(__file__).parents[1] / "data" / "calibration" / "sawicki_2016_thermal.json").read_text())
ANALOGUE, DIGITAL = TABLES["worked_example"], TABLES["worked_example_digital"]
MEASURED = [*TABLES["table_3"].items(), ("MPU-9255", TABLES["table_4"])]


def test_the_analogue_example_is_reproduced() -> None:
    """The printed accelerations come from voltages of more digits than printed: 0.2 mg apart."""
    found = force_g(np.array(ANALOGUE["V"]), ANALOGUE["V_0g"], ANALOGUE["sensitivity_V_per_g"])
    np.testing.assert_allclose(found, ANALOGUE["a_g"], atol=2e-4)
    assert squared_magnitude(*found.tolist()) == pytest.approx(ANALOGUE["squared_norm"], abs=3e-4)


def test_the_digital_example_is_reproduced() -> None:
    found = force_g(np.array(DIGITAL["raw"], dtype=np.float64), 0.0, DIGITAL["lsb_per_g"])
    np.testing.assert_allclose(found, DIGITAL["a_g"], atol=5.1e-5)


@pytest.mark.parametrize(("part", "table"), MEASURED)
def test_zero_g_output_and_sensitivity_follow_from_plus_and_minus_1_g(
    part: str, table: dict[str, dict[str, float]]
) -> None:
    """Every number is rounded to its last digit: one digit of difference is possible."""
    digit = 1.0 if part == "MPU-9255" else 0.001
    for axis in "xyz":
        plus, minus = float(table["plus_1g"][axis]), float(table["minus_1g"][axis])
        assert zero_g_output(plus, minus) == pytest.approx(table["zero_g"][axis], abs=digit)
        assert sensitivity(minus, plus) == pytest.approx(table["sensitivity"][axis], abs=digit)
        assert sensor_output(1.0, zero_g_output(plus, minus), sensitivity(minus, plus)) == pytest.approx(plus)


def test_the_output_at_plus_1_g_lies_between_the_limits_of_the_data_sheet() -> None:
    """Of the z axis of an ADXL335: 1.47 to 2.13 V, with the zero-g limits of Table 1."""
    limits = TABLES["table_3"]["ADXL335"]["datasheet"]
    outputs = [
        sensor_output(1.0, zero_g, per_g)
        for zero_g, per_g in zip(limits["zero_g_z"], limits["sensitivity"], strict=True)
    ]
    assert outputs == [pytest.approx(1.47), pytest.approx(1.80), pytest.approx(2.13)]


def test_sensitivity_from_any_two_forces_and_back() -> None:
    per_g = sensitivity(1.35, 1.65, force_1_g=-0.5, force_2_g=0.5)
    assert per_g == pytest.approx(0.3)
    assert force_g(sensor_output(0.7, 1.5, per_g), 1.5, per_g) == pytest.approx(0.7)
