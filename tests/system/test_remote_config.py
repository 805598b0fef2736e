"""`plumbline remote config` on a real gateway: proposed, applied, confirmed; and rolled back where the gateway is not healthy."""

import tomllib
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.system.conftest import BusPeer, JoinBus, Plumbline, RunningGateway, StartGateway

pytestmark = pytest.mark.slow

FILE = '[gateway]\nsite = "yard"\n\n[alerts]\ntrip_deg = 6.0  # agreed with the owner\n'


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningGateway]:
    """A gateway with a short trial, whose file is the same after each test that takes it."""
    gateway = RunningGateway(tmp_path_factory.mktemp("gateway"), FILE, program=("tests.system.short_trial",))
    with closing(BusPeer(gateway.endpoint)) as peer:
        peer.wait_for("health")
    yield gateway
    assert gateway.process.poll() is None
    gateway.stop()


def _file(gateway: RunningGateway) -> Path:
    return gateway.data_dir.with_name("gateway.toml")


def _remote(plumbline: Plumbline, gateway: RunningGateway, *arguments: str | Path) -> tuple[int, str, str]:
    link = ("--by", "ann", "--connect", gateway.endpoint, "--credentials", str(gateway.data_dir))
    done = plumbline("remote", "config", *arguments, *link)
    return done.returncode, done.stdout, done.stderr


def _proposal(folder: Path, text: str) -> Path:
    path = folder / "proposal.toml"
    path.write_text(text)
    return path


def test_a_change_is_proposed_applied_and_confirmed(
    start_gateway: StartGateway, plumbline: Plumbline, join_bus: JoinBus, tmp_path: Path
) -> None:
    gateway = start_gateway(FILE)
    join_bus(gateway.endpoint).wait_for("health")
    code, out, _ = _remote(plumbline, gateway, "get")
    assert code == 0
    assert tomllib.loads(out)["alerts"] == {"trip_deg": 6.0}
    wanted = _proposal(tmp_path, out.replace("6.0", "5.5"))
    code, out, _ = _remote(plumbline, gateway, "validate", wanted)
    assert (code, out) == (0, "alerts.trip_deg: 6.0 -> 5.5\n")
    code, out, _ = _remote(plumbline, gateway, "propose", wanted)
    assert code == 0
    proposal = out.split("config apply ")[1].split()[0]
    code, out, err = _remote(plumbline, gateway, "apply", proposal, "--reason", "shorter sling")
    assert (code, err) == (0, "")
    assert "confirmed: the gateway is healthy" in out
    assert "trip_deg = 5.5  # agreed with the owner" in (tmp_path / "gateway.toml").read_text()
    (changed,) = join_bus(gateway.endpoint).wait_for("health")["changed_limits"]
    assert changed.startswith("alerts.trip_deg is 5.5, changed over the bus; at commissioning it was 6;")
    assert changed in plumbline("fleet", "status", "--connect", gateway.endpoint, "--json", "-").stdout
    (kept,) = tmp_path.glob("gateway.toml.until-*")
    assert kept.read_text() == FILE
    assert not (tmp_path / "gateway.toml.trial.json").exists()
    assert gateway.process.poll() is None


def test_a_sensor_that_is_not_there_is_rolled_back_at_once(
    gateway: RunningGateway, plumbline: Plumbline, tmp_path: Path
) -> None:
    wanted = _proposal(tmp_path, '[device]\nkind = "adxl355"\nbus = 77\n')
    code, out, _ = _remote(plumbline, gateway, "propose", wanted)
    assert code == 0
    code, _, err = _remote(plumbline, gateway, "apply", out.split("config apply ")[1].split()[0])
    assert code == 1
    assert "rolled back: " in err
    assert "i2c-77" in err
    assert _file(gateway).read_text() == FILE
    code, out, _ = _remote(plumbline, gateway, "get")
    assert code == 0
    assert "adxl355" not in out


def test_a_change_with_which_alerts_cannot_be_raised_is_rolled_back(
    gateway: RunningGateway, plumbline: Plumbline, tmp_path: Path
) -> None:
    """Samples arrive, but each block is stale before the next one comes."""
    wanted = _proposal(tmp_path, '[device]\nkind = "simulated"\nodr_hz = 100\nblock_samples = 170\n')
    code, out, err = _remote(plumbline, gateway, "propose", wanted)
    assert code == 0, err
    code, out, err = _remote(plumbline, gateway, "apply", out.split("config apply ")[1].split()[0])
    assert code == 1, out
    assert "rolled back: " in err
    assert _file(gateway).read_text() == FILE


def test_refusals_are_one_line(gateway: RunningGateway, plumbline: Plumbline, tmp_path: Path) -> None:
    for text, why in (
        ("[alerts]\ntrip_deg = 1.0\n", "must hold"),
        ('[bus]\nlisten = ["tcp/127.0.0.1:9447"]\n', "allow it with --allow-network"),
        ("[recorder]\nquota_mb = 0.001\n", "is not between 1000 and"),
        ("[recorder]\nkeep_events_days = 0\n", "can only be changed on the gateway's own machine"),
        ('[recorder]\nkey = "/etc/shadow"\n', "can only be changed on the gateway's own machine"),
    ):
        code, out, err = _remote(plumbline, gateway, "propose", _proposal(tmp_path, text))
        assert (code, out) == (1, "")
        assert why in err
        assert err.count("\n") == 1
    assert _file(gateway).read_text() == FILE
