"""Deflection of a girder: the source's figures, its error table in simulation, recordings, and live tilts."""

import io
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.bench.deflection_history import LiveDeflection
from gateway.bench.girder_deflection import (
    EndRotation,
    Girder,
    deflection_under_load_m,
    end_rotation_under_load_rad,
    girder_deflection,
    inward_tilt_rad,
)
from gateway.bus.client import GatewayClient
from gateway.cli.fleet.fleet_deflection import show_deflection
from gateway.cli.main import main
from gateway.messages import Tilt
from gateway.numerics.array import Array
from gateway.topics import encode
from tests.recordings import write_mcap

SOURCE = Girder(half_span_m=0.8, load_offset_m=0.065)
STIFFNESS_N_M2 = 2.24e9 * 1e-6
LOAD_N = 50 * 9.8
MAX_DEFLECTION_M = 0.0205
LEFT_AXIS, RIGHT_AXIS = (0, 1), (0, -1)


def beam_by_integration(load_n: float, stiffness: float, girder: Girder, places: int = 200_001) -> tuple[float, float]:
    """Return deflection at mid-span and rotation of the left end by integrating the bending moment twice."""
    span, l, b = 2 * girder.half_span_m, girder.half_span_m, girder.load_offset_m  # noqa: E741
    x = np.linspace(0, span, places)
    moment = load_n / 2 * np.minimum(np.minimum(x, span - x), l - b)
    step = x[1]
    slope = np.concatenate([[0], np.cumsum((moment[1:] + moment[:-1]) / 2) * step]) / stiffness
    shape = np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2) * step])
    rotation = shape[-1] / span
    return rotation * l - shape[places // 2], rotation


def test_both_equations_agree_with_the_integrated_bending_moment() -> None:
    deflection_m, rotation_rad = beam_by_integration(LOAD_N, STIFFNESS_N_M2, SOURCE)
    assert end_rotation_under_load_rad(LOAD_N, STIFFNESS_N_M2, SOURCE) == pytest.approx(rotation_rad, rel=1e-6)
    assert deflection_under_load_m(LOAD_N, STIFFNESS_N_M2, SOURCE) == pytest.approx(deflection_m, rel=1e-6)
    assert SOURCE.factor_m * rotation_rad == pytest.approx(deflection_m, rel=1e-6)


def test_the_source_s_figures_give_its_deflection_and_show_the_error_of_equation_26() -> None:
    """The printed factor l^2 + 2bl - b^2 is 7.2 % too large for l = 800 mm, b = 65 mm."""
    assert SOURCE.factor_m == pytest.approx(2 * (800**2 + 800 * 65 - 0.5 * 65**2) / (3 * 865) / 1000, rel=1e-12)
    assert SOURCE.factor_m == pytest.approx(0.53171, abs=1e-5)
    found_mm = 1000 * deflection_under_load_m(LOAD_N, STIFFNESS_N_M2, SOURCE)
    printed_mm = LOAD_N * 735 * (800**2 + 2 * 65 * 800 - 65**2) / (6 * 2.24e9)
    assert found_mm == pytest.approx(18.487, abs=0.001)
    assert printed_mm / found_mm == pytest.approx(1.0723, abs=1e-4)


def sensed_g(rotation_rad: float, axis: tuple[int, int], z_offset_mg: float = 0.0) -> Array:
    """Return the specific force at an end whose inward axis dips by this rotation, with a zero-g offset of z."""
    index, sign = axis
    force_g = np.zeros(3)
    force_g[index] = -sign * math.sin(rotation_rad)
    force_g[2] = math.cos(rotation_rad) + z_offset_mg / 1000
    return force_g


@pytest.mark.parametrize(
    ("z_offset_mg", "parameter_mg", "largest_mm"),
    [(-20.9, 0.0, 0.439), (-15.8, 0.0, 0.330), (-20.9, -18.9, 0.042)],
    ids=["raw", "six-parameter", "single-parameter"],
)
def test_the_errors_of_figure_15_follow_from_the_offset_that_each_method_leaves(
    z_offset_mg: float, parameter_mg: float, largest_mm: float
) -> None:
    """An offset of z multiplies relative angles by 1/(1 + A), and eq. 11 by exp(A): the largest errors at 20.5 mm."""
    rotation_rad = MAX_DEFLECTION_M / SOURCE.factor_m
    ends = []
    for axis in (LEFT_AXIS, RIGHT_AXIS):
        tilts = [inward_tilt_rad(sensed_g(angle, axis, z_offset_mg), axis) for angle in (0.0, rotation_rad)]
        ends.append(EndRotation(math.exp(parameter_mg / 1000) * float(tilts[0] - tilts[1]), 0.0, 0.0))
    error_mm = 1000 * (girder_deflection(ends[0], ends[1], SOURCE).deflection_m - MAX_DEFLECTION_M)
    assert error_mm == pytest.approx(largest_mm, abs=0.004)


def test_unequal_rotations_show_a_load_off_mid_span_and_widen_the_uncertainty() -> None:
    """A single load at 40 % of the span, by the theory of the beam."""
    girder, a = Girder(half_span_m=5.0), 4.0
    left_rad, right_rad = (a * (10 - a) * (10 + 10 - a) / 60 * 1e-4, a * (10 - a) * (10 + a) / 60 * 1e-4)
    true_m = a * (3 * 100 - 4 * a**2) / 48 * 1e-4
    found = girder_deflection(EndRotation(left_rad, 1e-6, 0.0), EndRotation(right_rad, 1e-6, 0.0), girder)
    assert found.off_centre == pytest.approx(0.1, rel=1e-3)
    assert abs(found.deflection_m - true_m) < found.u_m
    assert found.u_m == pytest.approx(0.02 * true_m, rel=0.1)
    far = girder_deflection(EndRotation(2e-3, 1e-6, 0.0), EndRotation(-1e-4, 1e-6, 0.0), girder)
    assert "the ends turn in opposite senses" in far.warnings[0]


def test_an_axis_the_wrong_way_round_shows_under_a_load_at_mid_span() -> None:
    """The rotations then cancel: 20 mm read as 0.1 mm."""
    found = girder_deflection(
        EndRotation(5.06e-3, 2e-5, 0.01), EndRotation(-4.89e-3, 2e-5, 0.01), Girder(half_span_m=5.0)
    )
    assert "an axis is the wrong way round" in found.warnings[0]


def test_an_end_that_does_not_turn_beyond_its_noise_is_no_wrong_axis() -> None:
    found = girder_deflection(EndRotation(5e-5, 2e-5, 0.01), EndRotation(-4e-5, 2e-5, 0.01), Girder(half_span_m=5.0))
    assert not found.warnings


def test_the_uncertainty_holds_angles_and_dimensions() -> None:
    girder = replace(SOURCE, u_half_span_m=0.001, u_load_offset_m=0.001)
    random = np.random.default_rng(2)
    drawn = [
        (random.normal(0.03, 2e-5) + random.normal(0.03, 2e-5)) / 2
        * Girder(random.normal(0.8, 0.001), random.normal(0.065, 0.001)).factor_m
        for _ in range(4000)
    ]  # fmt: skip
    end = EndRotation(0.03, 2e-5, 0.0)
    assert girder_deflection(end, end, girder).u_m == pytest.approx(np.std(drawn), rel=0.05)


DEVICE = DeviceInfo(kind="test", device_id="left", unit="g", odr_hz=20.0, units_per_g=1.0, calibrated_source=True)
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a recording of one end: 20 s unloaded, then a load until 40 s, 0.3 mg of noise at 20 Hz."""

    def write(name: str, axis: tuple[int, int], rotation_rad: float, begin_s: float = 0.0) -> Path:
        random = np.random.default_rng(len(name) + axis[1])
        time_s = begin_s + np.arange(800) / 20
        resting = np.array([0.01, -0.02, 1.0])
        force_g = resting + 3e-4 * random.standard_normal((800, 3))
        loaded = time_s > 20
        force_g[loaded, axis[0]] -= axis[1] * math.sin(rotation_rad)
        path = tmp_path / name
        if path.suffix == ".mcap":
            return write_mcap(path, replace(DEVICE, device_id=name), force_g, begin_s=begin_s, sensor=path.stem)
        rows = np.column_stack([time_s, force_g])
        np.savetxt(path, rows, delimiter=",", header="time_s,ax_g,ay_g,az_g", comments="", fmt="%.7f")
        return path

    return write


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["mcap", "csv"])
def test_a_planted_deflection_is_found_in_two_recordings(
    write: Write, suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rotation_rad = 0.02 / SOURCE.factor_m
    left = write(f"left.{suffix}", LEFT_AXIS, rotation_rad)
    right = write(f"right.{suffix}", RIGHT_AXIS, rotation_rad, begin_s=3.0)
    out, table, page = (tmp_path / name for name in ("d.json", "d.csv", "d.html"))
    options = [
        "--half-span-m",
        "0.8",
        "--load-offset-m",
        "0.065",
        "--json",
        out,
        "--csv",
        table,
        "--html",
        page,
        "--by",
        "Ann",
    ]
    assert main(["fleet", "deflection", str(left), str(right), *map(str, options)]) == 0
    result = json.loads(out.read_text())
    at_end = result["series"][-1]
    assert at_end[1] == pytest.approx(0.02, abs=2 * at_end[2])
    assert at_end[2] < 0.03 * 0.02
    before = [row for row in result["series"] if row[0] < 15]
    assert all(abs(row[1]) < 4 * row[2] for row in before)
    assert table.read_text().startswith("time_s,deflection_m,u_m,")
    assert "<svg" in page.read_text()
    assert result["traceability"]["By"] == "Ann"
    for value in result["traceability"].values():
        assert value in page.read_text(), value
    assert "largest: deflection +20." in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["{left}", "plumbline/v1/a/b/c"], "give two recordings, or two keys"),
        (["{left}", "{late}"], "share 0.0 s"),
        (["{left}", "{csv}"], "one recording has dates and the other none"),
        (["{left}", "{right}", "--load-offset-m", "0.9"], "--load-offset-m must be below"),
        (["{left}", "{right}", "--zero-s", "2"], "2 s of the zero have samples"),
    ],
)
def test_what_cannot_be_evaluated_is_one_line(
    write: Write, capsys: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    files = {
        "left": write("left.mcap", LEFT_AXIS, 0.01),
        "right": write("right.mcap", RIGHT_AXIS, 0.01),
        "late": write("late.mcap", RIGHT_AXIS, 0.01, begin_s=100.0),
        "csv": write("right.csv", RIGHT_AXIS, 0.01),
    }
    named = [argument.format(**files) for argument in arguments]
    assert main(["fleet", "deflection", *named, "--half-span-m", "0.8"]) == 2
    err = capsys.readouterr().err
    assert text in err
    assert err.count("\n") == 1


def tilt_message(number: int, force_g: Array, trusted: bool = True) -> Tilt:
    return Tilt(
        time_ns=number * 100_000_000, clock="synchronised", sequence=number, calibration_id="r1",
        specific_force_g=force_g.tolist(), delay_s=0.2, trusted=trusted,
    )  # fmt: skip


def test_live_tilts_give_the_deflection_after_the_zero_and_the_reason_before() -> None:
    live = LiveDeflection(SOURCE, (LEFT_AXIS, RIGHT_AXIS), (0.005, 0.005), zero_s=3.0)
    rotation_rad = 0.01 / SOURCE.factor_m
    random = np.random.default_rng(3)
    texts = []
    for number in range(80):
        angle_rad = rotation_rad if number > 50 else 0.0
        for side, axis in (("left", LEFT_AXIS), ("right", RIGHT_AXIS)):
            force_g = sensed_g(angle_rad, axis) + 1e-5 * random.standard_normal(3)
            view = live.add(side, tilt_message(number, force_g))  # type: ignore[arg-type]
            texts.append(view.text)
    assert texts[0] == "right end: no tilt yet"
    assert "zero: keep the girder unloaded for 3 s" in texts
    assert view.deflection is not None
    assert view.deflection.deflection_m == pytest.approx(0.01, abs=2 * view.deflection.u_m)
    assert live.add("left", tilt_message(81, np.array([0, 0, 1.0]), trusted=False)).text.startswith(
        "left end: the reading"
    )
    live.add("left", tilt_message(120, sensed_g(0.0, LEFT_AXIS)))
    assert "apart" in live.add("left", tilt_message(121, sensed_g(0.0, LEFT_AXIS))).text


class ScriptedEnd(GatewayClient):
    """Sends scripted tilts of one end; both ends send in turn once both are subscribed."""

    def __init__(self, messages: list[Tilt], takers: list[tuple[list[Tilt], Callable[[Any], object]]]) -> None:
        self._messages = messages
        self._takers = takers

    def subscribe(self, topic: str, receive: Callable[[Any], object]) -> None:
        self._takers.append((self._messages, receive))
        if len(self._takers) == 2:
            for number in range(len(self._messages)):
                for messages, take in self._takers:
                    take(json.loads(encode(messages[number])))


def test_the_terminal_shows_the_deflection() -> None:
    rotation_rad = 0.01 / SOURCE.factor_m
    takers: list[tuple[list[Tilt], Callable[[Any], object]]] = []
    left, right = (
        ScriptedEnd(
            [tilt_message(number, sensed_g(rotation_rad if number > 15 else 0.0, axis)) for number in range(30)], takers
        )
        for axis in (LEFT_AXIS, RIGHT_AXIS)
    )
    live = LiveDeflection(SOURCE, (LEFT_AXIS, RIGHT_AXIS), (0.0, 0.0), zero_s=1.0)
    out = io.StringIO()
    assert show_deflection((left, right), live, out, count=36) == 0
    lines = out.getvalue().splitlines()
    assert lines[0] == "right end: no tilt yet"
    assert "deflection +10.000 +- 0.000 mm" in lines[-1]


@pytest.mark.slow
def test_a_load_step_that_ends_see_at_different_seconds_gives_one_warning_at_most(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = write("left.csv", LEFT_AXIS, 0.01), write("right.csv", RIGHT_AXIS, 0.01)
    rows = np.loadtxt(right, delimiter=",", skiprows=1)
    rows[:, 0] += 4.5  # the clock of the right end
    np.savetxt(right, rows, delimiter=",", header="time_s,ax_g,ay_g,az_g", comments="", fmt="%.7f")
    out = tmp_path / "d.json"
    assert main(["fleet", "deflection", str(left), str(right), "--half-span-m", "5", "--json", str(out)]) == 0
    capsys.readouterr()
    assert len(json.loads(out.read_text())["warnings"]) <= 1
