"""Simulated recordings, read back by the gateway's own tools."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from devices.tables.native import read_table
from gateway.cli.main import main
from gateway.measurement.source import read_source
from gateway.recording.reading.samples import read_samples
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.simulation import Simulated, simulate

RIG = """[rope]
length_m = 9.0
[housing]
position_m = 6.0
[sensor]
sample_rate_hz = 50
noise_g = 0.0004
"""


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    return path


@pytest.mark.slow
def test_simulated_swing_is_measured(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, result = tmp_path / "log.csv", tmp_path / "result.json"
    start = ["tilt_x_deg=4", "tilt_y_deg=0", "rate_x_deg_s=0", "rate_y_deg_s=0"]
    assert main(["simulate", str(rig), "--out", str(log), "--initial", *start]) == 0
    assert "6000 samples at 50 Hz; effects: none" in capsys.readouterr().out
    assert main(["measure", str(log), "--rig", str(rig), "--json", str(result)]) == 0
    swing = json.loads(result.read_text())["swing"]
    assert abs(swing["phi_max_deg"] - 4.0) < 4 * swing["u_deg"] < 0.1


@pytest.mark.slow
def test_mcap_is_complete_and_has_the_samples_of_the_csv(rig: Path, tmp_path: Path) -> None:
    for name in ("log.csv", "log.mcap"):
        assert main(["simulate", str(rig), "--out", str(tmp_path / name), "--duration", "40", "--seed", "3"]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.csv", "log.mcap", "rig.toml"]
    run = read_samples([tmp_path / "log.mcap"])
    assert run.recording().raw == pytest.approx(read_table(tmp_path / "log.csv").raw, abs=1e-7)
    assert run.device.kind == "simulated"
    configuration_toml = run.files[0].configuration_toml
    assert configuration_toml is not None
    assert tomllib.loads(configuration_toml)["rope"]["length_m"] == 9.0
    housing = read_source([tmp_path / "log.mcap"]).housing
    assert housing is not None
    assert housing.position_m == 6.0


def test_same_seed_gives_the_same_recording(rig: Path, tmp_path: Path) -> None:
    texts = []
    for name, seed in (("a.csv", "5"), ("b.csv", "5"), ("c.csv", "6")):
        main(["simulate", str(rig), "--out", str(tmp_path / name), "--duration", "5", "--seed", seed])
        texts.append((tmp_path / name).read_text())
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--out", "log.txt"], "should end in .csv or .mcap"),
        (["--out", "log.csv", "--effect", "storm"], "is no effect; known are"),
        (["--out", "log.csv", "--initial", "tilt_x_deg"], "should be NAME=VALUE"),
        (
            ["--out", "log.csv", "--initial", "height_m=3"],
            "the initial state has no height_m; its coordinates are tilt_x_deg",
        ),
        (["--out", "log.csv", "--effect", "double_pendulum", "--effect", "rope_stretch"], "cannot act together"),
        (
            ["--out", "log.csv", "--initial", "tilt_y_deg=95"],
            "initial.tilt_y_rad = 1.65806 should be from -1.5 to 1.5 rad",
        ),
        (["--out", "log.csv", "--effect", "double_pendulum:rigging_length_m=9"], "should be from 0.2 to 8.55 m here"),
        (["--out", "log.csv", "--duration", "0.01"], "holds no two samples"),
    ],
)
def test_bad_input_is_one_line(
    rig: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    text: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", str(rig), *arguments]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["rig.toml"]


def nominal(noise_g: float = 4e-4) -> TwinRig:
    return TwinRig(9.0, 6.0, noise_g=(noise_g,) * 3, sample_rate_hz=50.0)


def simulated(effects: EffectValues, duration_s: float = 60.0, noise_g: float = 4e-4) -> Simulated:
    return simulate(Model(nominal(noise_g), effects), duration_s, 1, {})


def test_noise_is_that_of_the_rig() -> None:
    hanging = simulate(
        Model(nominal(1e-3), {}),
        60.0,
        1,
        dict.fromkeys(["tilt_x_rad", "tilt_y_rad", "rate_x_rad_s", "rate_y_rad_s"], 0.0),
    )
    assert hanging.force_g.std(axis=0) == pytest.approx(1e-3, rel=0.05)
    assert hanging.force_g.mean(axis=0) == pytest.approx([0, 0, 1], abs=1e-4)


def test_quantisation_clipping_and_sample_loss_act_after_the_noise() -> None:
    steps = simulated({"quantization": {"lsb_g": 4e-3}}).force_g / 4e-3
    assert np.abs(steps - np.rint(steps)).max() < 1e-9
    assert simulated({"clipping": {"full_scale_g": 1.0}}).force_g.max() == 1.0
    lossy = simulated({"sample_loss": {"fraction": 0.1}})
    assert 2600 < len(lossy.time_s) < 2800
    assert np.diff(lossy.time_s) == pytest.approx(0.02)


@pytest.mark.slow
def test_initial_state_excites_all_modes_of_a_structure() -> None:
    bouncing = simulated({"rope_stretch": {"frequency_hz": 2.0, "damping_ratio": 0.001}}, noise_g=2e-4).force_g[:, 2]
    spectrum = np.abs(np.fft.rfft(bouncing - bouncing.mean()))
    assert np.argmax(spectrum) * 50 / len(bouncing) == pytest.approx(2.0, abs=0.02)
    hook = {"rigging_length_m": 3.0, "hook_mass_ratio": 0.2}
    assert np.ptp(simulated({"double_pendulum": hook}).force_g[:, 0]) > 0.02


def test_missing_library_is_named_with_the_correction(
    rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "casadi" else object())
    assert main(["simulate", str(rig), "--out", str(tmp_path / "log.csv")]) == 2
    assert "casadi not installed; install the extra twin, in a clone by" in capsys.readouterr().err
