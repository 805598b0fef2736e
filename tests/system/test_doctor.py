"""`plumbline doctor` beside nothing, beside a gateway that runs, and beside one that does not answer."""

import json
import os
import signal
import subprocess
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.configuration.loading import load
from gateway.daemon.doctor.checks import examine, examine_sensor_as_user
from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.chain_state import read_state, save_state
from tests.system.conftest import ROOT, JoinBus, Plumbline, RunningGateway, StartGateway


def _config(folder: Path, data_dir: Path, endpoint: str) -> Path:
    path = folder / "doctor.toml"
    path.write_text(
        f"[gateway]\ndata_dir = {json.dumps(str(data_dir))}\n[bus]\nlisten = [{json.dumps(endpoint)}]\n[page]\nenabled = false\n"
    )
    return path


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningGateway]:
    """A gateway for tests that only look at it."""
    running = RunningGateway(tmp_path_factory.mktemp("gateway"))
    yield running
    running.stop()


@pytest.mark.slow
def test_doctor_reports_the_state_of_a_running_gateway(
    gateway: RunningGateway, join_bus: JoinBus, plumbline: Plumbline, tmp_path: Path
) -> None:
    join_bus(gateway.endpoint).wait_for("health", lambda health: health["measured_rate_hz"] is not None)
    config = _config(tmp_path, gateway.data_dir, gateway.endpoint)
    done = plumbline("doctor", "--config", config)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ok   gateway      has been running for" in done.stdout
    assert "ok   recording" in done.stdout
    assert "BAD" not in done.stdout
    assert done.stdout.endswith("\nrunning, all well\n")


@pytest.mark.slow
def test_suspended_alerts_are_not_well(
    start_gateway: StartGateway, join_bus: JoinBus, plumbline: Plumbline, tmp_path: Path
) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("calibration")
    words = ["remote", "recalibrate", "--by", "ann", "--housing-off-rope", "--connect", gateway.endpoint]
    with subprocess.Popen([sys.executable, "-m", "gateway", *words], cwd=ROOT, stdout=subprocess.DEVNULL) as follower:
        peer.wait_for("alert", lambda alert: alert["validity"] == "suspended")
        config = _config(tmp_path, gateway.data_dir, gateway.endpoint)
        done = plumbline("doctor", "--config", config)
        follower.terminate()
    gateway.stop(signal.SIGKILL)
    assert "has been running" in done.stdout
    assert "has been running" not in plumbline("doctor", "--config", config).stdout
    assert "note alerts       swing unknown: SUSPENDED" in done.stdout
    assert done.stdout.endswith("\nrunning, and alerts are suspended\n")


@pytest.mark.slow
def test_doctor_states_that_a_running_gateway_does_not_answer(
    gateway: RunningGateway, join_bus: JoinBus, plumbline: Plumbline, tmp_path: Path
) -> None:
    join_bus(gateway.endpoint).wait_for("health")
    done = plumbline("doctor", "--config", _config(tmp_path, gateway.data_dir, "tcp/127.0.0.1:1"))
    assert done.returncode == 1
    assert "BAD  gateway      does not answer" in done.stdout
    assert done.stdout.endswith("\n1 to correct, marked BAD\n")


@pytest.mark.slow
def test_doctor_makes_no_folder(plumbline: Plumbline, tmp_path: Path) -> None:
    data_dir = tmp_path / "yard" / "data"
    done = plumbline("doctor", "--config", _config(tmp_path, data_dir, "tcp/127.0.0.1:0"))
    assert "is made at the first start" in done.stdout
    assert not data_dir.parent.exists()


@pytest.mark.slow
def test_doctor_names_a_damaged_chain_and_what_was_kept_of_it(plumbline: Plumbline, tmp_path: Path) -> None:
    data_dir = tmp_path / "data"
    data_dir.mkdir()
    config = _config(tmp_path, data_dir, "tcp/127.0.0.1:0")
    assert "chain" not in plumbline("doctor", "--config", config).stdout
    (data_dir / "chain.json").write_bytes(b'{"final_sha256":"\xe1"}')
    done = plumbline("doctor", "--config", config)
    assert done.returncode == 1
    assert f"BAD  chain        {data_dir}/chain.json: is damaged; the next start keeps it aside" in done.stdout
    (data_dir / "chain.json").rename(data_dir / "chain.json.damaged-1")
    done = plumbline("doctor", "--config", config)
    assert done.returncode == 0
    assert "note chain" in done.stdout
    assert f"note gateway      none runs with {data_dir}" in done.stdout
    assert done.stdout.endswith("\nall well for a start: no gateway runs\n")
    assert "has chain.json.damaged-1, kept from damage" in done.stdout


@pytest.mark.slow
def test_doctor_examines_a_sensor_alone_and_records_what_it_measured(plumbline: Plumbline, tmp_path: Path) -> None:
    config, path = _config(tmp_path, tmp_path / "data", "tcp/127.0.0.1:0"), tmp_path / "doctor.json"
    done = plumbline("doctor", "--device", "--config", config, "--json", path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "samples/s, nominal 125" in done.stdout
    assert "+z face is up" in done.stdout
    assert done.stdout.endswith("\nall well\n")
    checks = {check["place"]: check for check in json.loads(path.read_text())["checks"]}
    assert list(checks) == ["settings", "reading", "attitude"]
    assert checks["reading"]["values"]["device_id"] == "simulated-1"
    assert abs(checks["attitude"]["values"]["housing_g"][2] - 1) < 0.1


@pytest.mark.slow
def test_doctor_leaves_a_sensor_alone_that_a_gateway_uses(
    gateway: RunningGateway, join_bus: JoinBus, plumbline: Plumbline, tmp_path: Path
) -> None:
    join_bus(gateway.endpoint).wait_for("health")
    done = plumbline("doctor", "--device", "--config", _config(tmp_path, gateway.data_dir, gateway.endpoint))
    assert done.returncode == 1
    assert "a gateway is using the sensor; stop it first" in done.stdout


@pytest.mark.slow
def test_the_bundle_has_what_a_service_engineer_needs_and_no_secret(
    start_gateway: StartGateway,
    join_bus: JoinBus,
    plumbline: Plumbline,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gateway = start_gateway()
    join_bus(gateway.endpoint).wait_for("health", lambda health: health["recording"] and health["state"] == "running")
    secrets = {"command-token": "tok-5f2a9c", "page-pin": "48151623", "signing-key-2.pem": "MC4CAQAwBQYDK2Vw"}
    for name, value in secrets.items():
        (gateway.data_dir / name).write_text(f"{value}\n")
    (gateway.data_dir / "calibration").mkdir(exist_ok=True)
    with (gateway.data_dir / "calibration" / "audit.jsonl").open("a") as audit:
        audit.write('{"by": "ann", "reason": "token tok-5f2a9c typed by mistake"}\n')
    journal = tmp_path / "bin" / "journalctl"
    journal.parent.mkdir()
    journal.write_text(
        "#!/bin/sh\necho 'pin 48151623'; echo 'mqtt://ann:hunter22@host failed'; echo password=hunter22\n"
    )
    journal.chmod(0o755)
    bundle = tmp_path / "crane.tar.gz"
    config = _config(tmp_path, gateway.data_dir, gateway.endpoint)
    monkeypatch.setenv("PATH", f"{journal.parent}:{os.environ['PATH']}")
    done = plumbline("doctor", "--bundle", bundle, "--config", config)
    assert "without passwords" in done.stderr
    with tarfile.open(bundle) as archive:
        parts = {name.partition("/")[2]: archive.extractfile(name).read().decode() for name in archive.getnames()}  # type: ignore[union-attr]
    assert set(parts) == {
        "doctor.json", "versions.json", "configuration.json", "status.json", "unit.txt", "log.txt", "audit.jsonl", "files.txt"
    }  # fmt: skip
    everything = "".join(parts.values())
    for secret in (*secrets.values(), "hunter22"):
        assert secret not in everything
    assert "pin (removed)" in parts["log.txt"]
    assert '"by": "ann"' in parts["audit.jsonl"]
    assert json.loads(parts["status.json"])["health"]["state"] == "running"
    assert any(check["place"] == "gateway" for check in json.loads(parts["doctor.json"]))
    assert json.loads(parts["configuration.json"])["alerts"]["trip_deg"] == 6.0
    assert "numpy" in json.loads(parts["versions.json"])["distributions"]
    assert ".mcap" in parts["files.txt"]


@pytest.fixture
def of_another_user(tmp_path: Path) -> Path:
    """The settings of a service that may write them: its bus would take the place of a file."""
    victim, data_dir, path = tmp_path / "victim", tmp_path / "data", tmp_path / "doctor.toml"
    victim.write_text("precious")
    data_dir.mkdir()
    if os.geteuid() == 0:
        os.chown(data_dir, 65534, 65534)
    path.write_text(
        f"[gateway]\ndata_dir = {json.dumps(str(data_dir))}\n[page]\nenabled = false\n"
        f'[bus]\nlisten = ["unixsock-stream/{victim}"]\n'
    )
    return path


def test_doctor_as_root_opens_nothing_that_the_settings_of_another_user_name(
    of_another_user: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    configuration = load(of_another_user)
    results = list(examine(configuration))
    assert {"bus", "device", "calibration"}.isdisjoint(result.place for result in results)
    assert any("root opens neither sensor nor bus" in result.text for result in results)
    (result,) = examine_sensor_as_user(configuration)
    assert (result.grade, result.place) == ("bad", "device")
    assert (of_another_user.parent / "victim").read_text() == "precious"


@pytest.mark.slow
def test_doctor_names_a_chain_that_another_key_has_signed(
    start_gateway: StartGateway, plumbline: Plumbline, tmp_path: Path
) -> None:
    ended = start_gateway(arguments=["--duration", "2"])
    assert ended.wait()[0] == 0
    data_dir = ended.data_dir
    config = _config(tmp_path, data_dir, "tcp/127.0.0.1:0")
    assert " chain  " not in plumbline("doctor", "--config", config).stdout
    state = read_state(data_dir)
    assert state is not None
    for key in (load_or_create_key(tmp_path / "another-key.pem"), None):  # by somebody else; without a signature
        save_state(data_dir, state, key)
        assert "BAD  chain " in plumbline("doctor", "--config", config).stdout
