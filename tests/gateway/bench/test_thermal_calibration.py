"""Thermal calibration: published coefficients planted in ramps, their verdicts, the model and its correction."""

import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from gateway.bench.thermal.hysteresis import play
from gateway.bench.thermal.output import thermal_figure
from gateway.bench.thermal.ramp_calibration import LIMITS_BY_PART, ThermalCalibration, calibrate_ramps, judge_interval
from gateway.bench.thermal.ramp_regression import AxisRegression
from gateway.bench.thermal.rest_calibration import learn_at_rest
from gateway.bench.thermal.slow_noise import NoiseRatios, RecordingNoise
from gateway.calibration.acceptance import add_content_hash, change_since, make_record
from gateway.calibration.correction import correction_for
from gateway.calibration.drift.change import change_between
from gateway.calibration.input_files import FileReadings
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.methods.zeroing import zero_in_place
from gateway.calibration.pose import FACE_DIRECTIONS, Pose, RawReadings
from gateway.calibration.record import CalibrationError, CalibrationRecord, NotDeterminedError
from gateway.calibration.thermal_model import thermal_model
from gateway.errors import InputError
from gateway.pipeline.force_stage import TIME_CONSTANT_S, ForceStage
from gateway.stages.lowpass import LowPass
from tests.gateway.bench.thermal_sensors import SENSORS, planted, ramps
from tests.gateway.conftest import record_content
from tests.values import present

AXES = ((0, 1), (1, 1), (2, 1))


@pytest.fixture(scope="module")
def calibrations() -> dict[str, ThermalCalibration]:
    random = np.random.default_rng(4)
    return {sensor: calibrate_ramps(ramps(sensor, random), limits=LIMITS_BY_PART[sensor]) for sensor in SENSORS}


def make(found: ThermalCalibration) -> CalibrationRecord:
    return make_record(
        found.fit, device_id="part-7", unit=found.unit, software="0.1.0", by="bench",
        created_utc="2026-11-21T10:15:00Z", parent=None,
    )  # fmt: skip


def device(unit: str, units_per_g: float) -> DeviceInfo:
    assert unit == "counts"
    return DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=20.0, units_per_g=units_per_g)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", SENSORS)
def test_planted_coefficients_are_recovered(calibrations: dict[str, ThermalCalibration], sensor: str) -> None:
    zero_g, sensitivity, offset_mg, scale_percent = planted(sensor)
    for axis, entry in enumerate(calibrations[sensor].summary):
        for found, value in (
            (entry.offset_mg_per_c, offset_mg[axis]),
            (entry.sensitivity_percent_per_c, scale_percent[axis]),
        ):
            half = (found.ci95[1] - found.ci95[0]) / 2
            assert abs(found.value - value) < 1.6 * half  # about 3 standard uncertainties
        assert entry.offset_mg_per_c.ci95[1] - entry.offset_mg_per_c.ci95[0] < 0.05
        assert entry.zero_g == pytest.approx(zero_g[axis], abs=5e-4 * sensitivity[axis])
        assert entry.sensitivity == pytest.approx(sensitivity[axis], rel=5e-4)


@pytest.mark.parametrize("sensor", SENSORS)
def test_the_figure_shows_the_half_sums_of_opposite_ramps(
    calibrations: dict[str, ThermalCalibration], sensor: str
) -> None:
    """Sawicki and Walendziuk 2016, eq. 8, in mg from the reference on."""
    *_, offset_mg, _ = planted(sensor)
    for axis, series in enumerate(thermal_figure(calibrations[sensor]).series):
        np.testing.assert_allclose(series.y, offset_mg[axis] * (np.array(series.x) - 25), atol=1.0)


def test_the_verdicts_are_those_of_the_published_tables(calibrations: dict[str, ThermalCalibration]) -> None:
    """The z axes of two analogue parts exceed 1 mg/°C, the x axis of a third 0.4 mg/°C and 0.01 %/°C."""
    exceeds = {
        (sensor, entry.axis, name)
        for sensor, found in calibrations.items()
        for entry in found.summary
        for name, verdict in (("offset", entry.offset_mg_per_c.verdict), ("sensitivity", entry.sensitivity_percent_per_c.verdict))
        if verdict == "exceeds"
    }  # fmt: skip
    assert {("ADXL335", "z", "offset"), ("ADXL327", "z", "offset"), ("LIS344ALH", "x", "offset")} <= exceeds
    assert ("LIS344ALH", "x", "sensitivity") in exceeds
    assert {sensor for sensor, _, name in exceeds if name == "offset"} == {"ADXL335", "ADXL327", "LIS344ALH"}
    assert all(entry.verdict == "within" for entry in calibrations["MPU-9255"].summary)


def test_sensitivity_and_zero_g_at_25_c_are_judged_by_table_3(calibrations: dict[str, ThermalCalibration]) -> None:
    for sensor in ("ADXL335", "ADXL327", "LIS344ALH"):
        assert all(entry.sensitivity_verdict == "within" for entry in calibrations[sensor].summary)
        assert all(entry.zero_g_verdict == "within" for entry in calibrations[sensor].summary)
    assert calibrations["MPU-9255"].summary[0].sensitivity_verdict is None


@pytest.mark.parametrize(
    ("low", "high", "limits", "verdict"),
    [
        (-0.5, 0.5, (-1.0, 1.0), "within"),
        (0.9, 1.1, (-1.0, 1.0), "undecided"),
        (-1.3, -1.1, (-1.0, 1.0), "exceeds"),
        (0.2, 0.3, (0.4, 0.6), "exceeds"),
        (0, 1, None, None),
    ],
)
def test_an_interval_on_a_limit_is_undecided(
    low: float, high: float, limits: tuple[float, float] | None, verdict: str | None
) -> None:
    assert judge_interval(low, high, limits) == verdict


def test_a_sensor_without_a_square_gets_none(calibrations: dict[str, ThermalCalibration]) -> None:
    for entry in (entry for found in calibrations.values() for entry in found.summary):
        assert not entry.offset_mg_per_c.is_quadratic
        assert not entry.sensitivity_percent_per_c.is_quadratic


@pytest.mark.slow
def test_a_square_is_fitted_only_where_the_data_need_it() -> None:
    found = calibrate_ramps(ramps("ADXL335", np.random.default_rng(6), quadratic_mg=0.02))
    assert [entry.offset_mg_per_c.is_quadratic for entry in found.summary] == [False, False, True]
    slope = found.summary[2].offset_mg_per_c
    expected = -3.602 + 0.02 * (found.range_c[0] + found.range_c[1] - 50)
    assert slope.value == pytest.approx(expected, abs=0.03)


@pytest.mark.slow
def test_the_correction_applies_the_model_inside_the_range_and_widens_beyond() -> None:
    random = np.random.default_rng(8)
    record = make(calibrate_ramps(ramps("MPU-9255", random)))
    zero_g, sensitivity, offset_mg, scale_percent = planted("MPU-9255")
    correction = correction_for(device(record.unit, 16384.0), AXES, record)
    for temperature_c in (5.0, 25.0, 55.0):
        change = temperature_c - 25
        force_g = np.array([0.1, -0.2, 0.97])
        raw = zero_g + sensitivity * (force_g * (1 + scale_percent / 100 * change) + offset_mg / 1000 * change)
        found_g = correction.apply(raw[None], temperature_c)[0]
        np.testing.assert_allclose(found_g, force_g, atol=3e-4)
    inside_g, at_80_g = correction.u_force_g(force_g, 50.0), correction.u_force_g(force_g, 80.0)
    assert correction.kelvin_beyond(50.0) == 0
    assert correction.kelvin_beyond(80.0) in {20, 21}
    assert np.all(at_80_g > inside_g + 0.783e-3 * 15)
    np.testing.assert_allclose(correction.apply(raw[None], 80.0), correction.apply(raw[None], 60.0), atol=1e-4)


@pytest.mark.slow
def test_an_unknown_temperature_widens_and_is_reported() -> None:
    record = make(calibrate_ramps(ramps("MPU-9255", np.random.default_rng(8))))
    correction = correction_for(device(record.unit, 16384.0), AXES, record)
    assert correction.kelvin_beyond(None) >= 34
    assert correction.range_warnings(None) == (
        "widened: the temperature is not known, the thermal model is not applied",
    )


@pytest.mark.slow
def test_a_damaged_thermal_model_is_refused() -> None:
    record = make(calibrate_ramps(ramps("MPU-9255", np.random.default_rng(8))))
    damaged = record.model_copy(update={"thermal": present(record.thermal) | {"reference_c": 99.0}})
    with pytest.raises(CalibrationError, match="needs min_c <= reference_c"):
        correction_for(device("counts", 16384.0), AXES, damaged)


def test_ramps_that_do_not_determine_the_model_are_refused() -> None:
    files = ramps("ADXL335", np.random.default_rng(2), duration_s=120.0)
    with pytest.raises(NotDeterminedError, match=r"no ramp with -z up"):
        calibrate_ramps(files[:5] + files[:1])
    with pytest.raises(InputError, match=r"has no temperature"):
        calibrate_ramps([replace(file, temperature_c=None) for file in files])
    with pytest.raises(NotDeterminedError, match=r"needs 10 °C or more"):
        calibrate_ramps(ramps("ADXL335", np.random.default_rng(2), duration_s=120.0, low_c=20, high_c=25))
    moved = files[0].raw.copy()
    moved[1200:] += 0.05
    with pytest.raises(NotDeterminedError, match=r"the sensor was moved"):
        calibrate_ramps([replace(files[0], raw=moved), *files[1:]])
    with pytest.raises(InputError, match=r"--reference-c 80 lies outside"):
        calibrate_ramps(files, reference_c=80.0)


def service_recording(
    parent: CalibrationRecord, mg_per_c: float, random: np.random.Generator, days: int = 3
) -> FileReadings:
    """Return a hanging housing over some short days from 10 to 28 °C, at rest for most of the time, 20 Hz."""
    count = days * 6000
    time_s = np.arange(count) / 20
    temperature_c = 19 + 9 * np.sin(2 * np.pi * np.arange(count) / 6000) + 0.05 * random.standard_normal(count)
    force_g = np.tile([0.02, -0.01, np.sqrt(1 - 0.02**2 - 0.01**2)], (count, 1))
    swinging = (np.arange(count) % 1500) > 1200
    force_g[swinging, 0] += 0.2 * np.sin(2 * time_s[swinging])
    force_g[:, 2] += mg_per_c / 1000 * (temperature_c - 19)
    force_g += 0.002 * random.standard_normal((count, 3))
    raw = np.rint(force_g @ np.linalg.inv(parent.correction_matrix).T + parent.offset)
    return FileReadings(Path("service.mcap"), "counts", time_s, raw, temperature_c, 0)


@pytest.mark.slow
def test_a_coefficient_is_learned_at_rest_along_the_rope_and_offered() -> None:
    parent = CalibrationRecord.model_validate(record_content())
    fit, found = learn_at_rest([service_recording(parent, -3.6, np.random.default_rng(3))], parent)
    assert found.axis == "z"
    assert found.ci95[0] < -3.6 < found.ci95[1]
    assert found.ci95[1] - found.ci95[0] < 0.2
    assert fit.method == "thermal-rest"
    assert fit.offset == tuple(parent.offset)
    learned = make(ThermalCalibration(fit, "counts", (), found.range_c, ()))
    correction = correction_for(device("counts", 1000.0), AXES, learned)
    at_c = np.array([12.0, 26.0])
    reference_c = present(correction.thermal).reference_c
    raw = (np.array([[0, 0, 1 - 3.6e-3 * (each - reference_c)] for each in at_c])) @ np.linalg.inv(
        parent.correction_matrix
    ).T + parent.offset
    np.testing.assert_allclose(correction.apply(raw, at_c), [[0, 0, 1]] * 2, atol=1e-3)
    assert np.all(correction.u_zero_g_offset_g[:2] > 0.5e-3 * 7)  # the axes across the rope were not measured


@pytest.mark.slow
def test_too_little_warming_at_rest_teaches_nothing() -> None:
    parent = CalibrationRecord.model_validate(record_content())
    cold = service_recording(parent, -3.6, np.random.default_rng(3))
    with pytest.raises(NotDeterminedError, match="at rest the temperature varied by"):
        learn_at_rest([replace(cold, temperature_c=np.full(len(cold.raw), 20.0))], parent)


@pytest.mark.slow
def test_zeroing_applies_and_keeps_the_thermal_model() -> None:
    parent = make(calibrate_ramps(ramps("MPU-9255", np.random.default_rng(8), duration_s=1800.0)))
    zero_g, sensitivity, offset_mg, scale_percent = planted("MPU-9255")
    random = np.random.default_rng(9)
    warm_g = np.array([0.01, -0.02, 0.99975]) * (1 + scale_percent / 100 * 25) + offset_mg / 1000 * 25
    raw = zero_g + sensitivity * (warm_g + 1e-3 * random.standard_normal((2000, 3)))
    fit = zero_in_place(RawReadings(np.arange(2000) / 50, raw, 50.0), parent, np.eye(3), 16384.0)
    assert fit.thermal == parent.thermal
    np.testing.assert_allclose(
        change_since(fit, parent).offset_g, 0, atol=1e-9
    )  # both hold at the reference temperature
    removed = next(warning.text for warning in fit.warnings if warning.text.startswith("removed"))
    pitch_deg, roll_deg = (float(word) for word in removed.split() if word[0] in "+-")
    assert pitch_deg == pytest.approx(0.573, abs=0.01)
    assert roll_deg == pytest.approx(-1.146, abs=0.01)


@pytest.mark.slow
def test_the_pipeline_corrects_each_block_by_its_filtered_temperature() -> None:
    learned = make(calibrate_ramps(ramps("MPU-9255", np.random.default_rng(8))))
    zero_g, sensitivity, offset_mg, scale_percent = planted("MPU-9255")
    correction = correction_for(device("counts", 16384.0), AXES, learned)
    stage = ForceStage(correction, LowPass(1.0, 2, 20.0))
    for number in range(200):  # 200 s that warm from 25 to 45 °C
        temperature_c = 25 + number / 10
        change = temperature_c - 25
        reading = zero_g + sensitivity * (
            np.array([0, 0, 1.0]) * (1 + scale_percent / 100 * change) + offset_mg / 1000 * change
        )
        time_ns = np.arange(number * 20, number * 20 + 20) * 50_000_000
        stage.push(
            SampleBlock(time_ns, np.rint(np.tile(reading, (20, 1))).astype(np.int32), temperature_c=temperature_c)
        )
    batch = stage.take()
    lag_g = 0.1 * TIME_CONSTANT_S * 0.783e-3  # the filter lags by its time constant
    assert np.max(np.abs(batch.force_g - [0, 0, 1])) < lag_g + 3e-4
    uncorrected = dataclasses.replace(correction, thermal=None)
    assert np.max(np.abs(uncorrected.apply(batch.raw) - [0, 0, 1])) > 0.015


@pytest.mark.slow
def test_a_thermal_model_brings_readings_to_its_reference_temperature() -> None:
    learned = make(calibrate_ramps(ramps("MPU-9255", np.random.default_rng(8))))
    zero_g, sensitivity, offset_mg, scale_percent = planted("MPU-9255")
    force_g = np.array([[0.0, 0.0, 1.0]])
    raw = zero_g + sensitivity * (force_g * (1 + scale_percent / 100 * 30) + offset_mg / 1000 * 30)
    model, offset = present(thermal_model(learned)), np.array(learned.offset)
    found = model.to_reference(raw, offset, 55.0)
    np.testing.assert_allclose(found, zero_g + sensitivity * force_g, atol=16384 * 3e-4)
    np.testing.assert_allclose(model.to_reference(raw, offset, float("nan")), raw)


@pytest.mark.slow
def test_a_calibration_at_another_temperature_is_compared_through_the_thermal_model() -> None:
    """An unchanged sensor, calibrated in the heat: without the model its z offset would have moved by 18 mg."""
    parent = make(calibrate_ramps(ramps("MPU-9255", np.random.default_rng(8))))
    zero_g, sensitivity, offset_mg, scale_percent = planted("MPU-9255")
    poses = tuple(
        Pose((x, y, z), (2.0, 2.0, 2.0), 300, face, temperature_c=50.0)
        for face, (x, y, z) in (
            (face, (zero_g + sensitivity * (up * (1 + scale_percent / 100 * 25) + offset_mg / 1000 * 25)).tolist())
            for face, up in FACE_DIRECTIONS.items()
        )
    )
    later_fit = fit_six_positions(poses)
    later = make(ThermalCalibration(later_fit, "counts", (), (50.0, 50.0), ()))
    for change in (change_between(parent, later), change_since(later_fit, parent)):
        np.testing.assert_allclose(change.offset_g, 0, atol=5e-4)
        np.testing.assert_allclose(change.scale, 0, atol=5e-4)
    without = change_between(make_record_without_model(parent), later)
    assert abs(without.offset_g[2]) > 0.017


def make_record_without_model(record: CalibrationRecord) -> CalibrationRecord:
    return add_content_hash(record.model_dump(mode="json") | {"thermal": None})


def test_a_hysteresis_follows_the_temperature_by_its_width() -> None:
    temperature_c = np.array([[20.0, 21.0, 22.0, 30.0, 29.0, 27.0, 20.0]])
    np.testing.assert_allclose(play(temperature_c, 4.0, 0.0)[0], [0, -0.5, -1, -1, -0.5, 0.5, 1])
    np.testing.assert_allclose(play(temperature_c, 4.0, 1.0)[0], [1, 0.5, 0, -1, -0.5, 0.5, 1])


def test_what_dominates_the_uncertainty_is_named() -> None:
    causes = np.stack([np.diag([0.1, size]) for size in (1.0, 4.0, 9.0, 2.0)])
    fit = RecordingNoise(np.linspace(-0.5, 0.5, 4), NoiseRatios()).solve(
        np.ones((2, 4, 1)).cumsum(axis=1), np.eye(2, 4), np.zeros(1)
    )
    found = AxisRegression(np.zeros(2), np.ones(0), causes, np.zeros((2, 3)), fit)
    assert found.dominant(np.array([0.0, 1.0])) == "lag of the thermometer"
    assert found.dominant(np.array([1.0, 0.0])) == "noise"
    np.testing.assert_allclose(found.covariance, np.diag([0.4, 16.0]))


@pytest.mark.slow
def test_great_noise_dominates_the_uncertainty(calibrations: dict[str, ThermalCalibration]) -> None:
    for found in calibrations.values():
        assert {entry.offset_mg_per_c.dominated_by for entry in found.summary} <= {"noise", "drift in time"}
