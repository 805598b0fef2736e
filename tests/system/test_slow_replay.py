"""`plumbline run` with a replayed table that is too slow for the low-pass."""

from pathlib import Path

import pytest

from gateway.cli.main import main


@pytest.mark.slow
@pytest.mark.parametrize("interval_s", [0.5, 20.0])
def test_a_table_of_two_samples_per_second_or_fewer_is_refused_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], interval_s: float
) -> None:
    table = tmp_path / "log.csv"
    table.write_text("time_s,ax_g,ay_g,az_g\n" + "".join(f"{n * interval_s},0.01,0,1\n" for n in range(40)))
    configuration = tmp_path / "gateway.toml"
    configuration.write_text(
        f'[gateway]\ndata_dir = "{tmp_path}"\n[device]\nkind = "replay"\npath = "{table}"\n'
        "[rope]\nlength_m = 9.0\n[housing]\nposition_m = 4.0\n[page]\nenabled = false\n"
    )
    assert main(["run", "--config", str(configuration), "--duration", "2"]) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert "samples per second are too few for filter.cutoff_hz = 1" in line
