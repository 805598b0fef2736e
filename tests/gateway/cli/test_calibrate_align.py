"""Alignment on a shaft from a recording, in a terminal and on the page's state: what is shown, and when it ends."""

import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.bus.client import GatewayClient
from gateway.calibration.alignment.turn_advice import AligningUnit
from gateway.calibration.alignment.turn_assistant import TurnAssistant, format_turn
from gateway.cli.main import main
from gateway.cli.remote.remote_align import show_turns
from gateway.messages import Tilt
from gateway.numerics.array import Array
from gateway.topics import encode
from tests.gateway.calibration.test_turn_alignment import turning
from tests.recordings import write_mcap
from tests.values import present

RATE_HZ = 20.0


def session(tilts_deg: list[float], noise_g: float = 3e-4) -> Array:
    """Return turns of 30 s about x, the axis tilted towards z by each of these angles in turn, g, (n, 3).

    A person stops some degrees after a turn, adjusts, and goes on.
    """
    return np.vstack(
        [
            turning(0, (0, 0, tilt), per_turn=600, turns=1.05 if n == 0 else 1.2, noise_g=noise_g, seed=n)
            for n, tilt in enumerate(tilts_deg)
        ]
    )


def align(tmp_path: Path, *arguments: Any) -> tuple[int, dict[str, Any]]:
    out = tmp_path / "align.json"
    code = main(["calibrate", "align", *map(str, arguments), "--json", str(out)])
    return code, json.loads(out.read_text()) if out.exists() else {}


def write_volts(path: Path, force_g: Array) -> Path:
    """Write the output of an ADXL327 by a converter with a step of 0.15 mV, as in the source."""
    volts = np.rint((1.5 + 0.41 * force_g) / 0.00015) * 0.00015
    time_s = np.arange(len(volts)) / RATE_HZ
    table = np.column_stack([time_s, volts])
    np.savetxt(path, table, delimiter=",", header="time_s,ax_v,ay_v,az_v", comments="", fmt="%.6f")
    return path


@pytest.mark.slow
def test_the_adjustments_of_a_session_are_read_and_the_last_turn_is_aligned(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, page = write_volts(tmp_path / "x.csv", session([1.2, 0.3, 0.0])), tmp_path / "align.html"
    code, result = align(tmp_path, path, "--html", page)
    assert code == 0
    assert result["axis"] == "x"
    assert result["units_per_g"] == pytest.approx(0.41, rel=2e-3)
    assert result["step_g"] == pytest.approx(0.00015 / 0.41, rel=0.01)
    first, *_, last = result["turns"]
    assert math.degrees(first["towards_rad"][2]) == pytest.approx(1.2, abs=0.03)
    assert (first["state"], first["screw_axis"], last["state"]) == ("adjust", "y", "aligned")
    assert math.degrees(last["total_error_rad"]) < 0.04
    output = capsys.readouterr().out
    assert "turn screw 5 (about y)" in output
    assert "APE 0.0" in output
    assert "CE 0.00000" in output
    assert page.read_text().count("<svg") == 1


@pytest.mark.slow
def test_a_recording_of_the_gateway_that_is_not_aligned_is_exit_code_1(tmp_path: Path) -> None:
    device = DeviceInfo(kind="adxl355", device_id="part-7", unit="counts", odr_hz=RATE_HZ, units_per_g=256000.0)
    path = write_mcap(tmp_path / "x.mcap", device, 256000 * session([0.5, 0.5]))
    code, result = align(tmp_path, path, "--axis", "x", "--unit-reversed", "y")
    assert code == 1
    assert result["turns"][-1]["direction"] == "out"
    assert math.degrees(result["turns"][-1]["precision_error_rad"]) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(
    ("force_g", "text"),
    [
        (turning(0, (0, 0, 0.5), turns=0.6), "no full turn of the shaft"),
        (
            np.tile([0.0, 0.0, 1.0], (200, 1)) + np.random.default_rng(0).normal(0, 1e-3, (200, 3)),
            "no axis stays level",
        ),
    ],
)
def test_a_recording_without_turns_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], force_g: Array, text: str
) -> None:
    code, result = align(tmp_path, write_volts(tmp_path / "x.csv", force_g), "--unit", "V")
    assert (code, result) == (1, {})
    err = capsys.readouterr().err
    assert text in err
    assert err.count("\n") == 1


def tilt(number: int, force_g: Array) -> Tilt:
    axial_deg = math.degrees(math.atan2(math.hypot(force_g[0], force_g[1]), force_g[2]))
    return Tilt(
        time_ns=number * 100_000_000, clock="synchronised", sequence=number, calibration_id=None,
        axial_deg=axial_deg, specific_force_g=force_g.tolist(), delay_s=0.2, trusted=False,
    )  # fmt: skip


class ShaftGateway(GatewayClient):
    """Sends the tilts of a sensor that turns on a shaft, with the correction that is in force."""

    def __init__(self, force_g: Array, gain: Array | None = None) -> None:
        self._force_g = force_g
        self._gain = gain

    def status(self) -> dict[str, Any]:
        return {} if self._gain is None else {"calibration": {"in_force": {"gain_g_per_unit": self._gain.tolist()}}}

    def subscribe(self, topic: str, receive: Callable[[Any], object]) -> None:
        for number, force_g in enumerate(self._force_g):
            receive(json.loads(encode(tilt(number, force_g))))


@pytest.fixture(autouse=True)
def all_tilts_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.cli.remote.remote_align.MAX_QUEUED_TILTS", 10_000)


@pytest.mark.slow
def test_the_terminal_shows_each_turn_until_the_axis_is_aligned() -> None:
    out = io.StringIO()
    assert show_turns(ShaftGateway(session([0.8, 0.0])), TurnAssistant(), out) == 0
    text = out.getvalue()
    assert "x: 27.8" in text
    assert "turn screw 5 (about y) in by" in text
    assert "aligned within 0.030 deg" in text
    assert text.splitlines()[-1].startswith("APE 0.0")


@pytest.mark.slow
def test_a_correction_in_force_does_not_hide_the_misalignment() -> None:
    sensitivity = 256000 * np.array([[1.0, 0.0, np.radians(0.8)], [0, 1.0, 0], [0, 0, 1.0]])
    corrected_g = session([0.0])
    view = None
    assistant = TurnAssistant()
    assistant.set_gain(np.linalg.inv(sensitivity).tolist())
    for number, force_g in enumerate(corrected_g):
        view = assistant.add_tilt(tilt(number, force_g))
    advice = present(present(view).advice)
    assert advice.state == "adjust"
    assert "x is off by 0.80" in format_turn(present(view))


@pytest.mark.slow
def test_nothing_is_read_while_the_sensor_hangs_and_damaged_gains_are_ignored() -> None:
    assistant = TurnAssistant(AligningUnit())
    assistant.set_gain("nonsense")
    assistant.set_gain([[0, 0, 0]] * 3)
    assert assistant.add_tilt(tilt(0, np.array([0.05, 0.0, 1.0]))) is None
    for number, force_g in enumerate(session([0.4])):
        view = assistant.add_tilt(tilt(number + 1, force_g))
    assert present(present(view).turn).axis == 0
    assert assistant.add_tilt(tilt(10_000, np.array([0.05, 0.0, 1.0]))) is None
