"""Bad input: one clear line that names the place and the mend, exit code 2, nothing left behind."""

import pytest

from gateway.cli.main import main
from tests.gateway.recording.recorded_files import summarise
from tests.system.conftest import ROOT, JoinBus, Plumbline, StartGateway, run_process

pytestmark = pytest.mark.slow


def one_line(err: str) -> str:
    lines = err.strip().splitlines()
    assert len(lines) == 1, err
    assert "Traceback" not in err
    return lines[0]


REFUSED = {
    "unknown key": ("[rope]\nlength_mm = 5\n", "did you mean length_m?"),
    "missing port": ('[device]\nkind = "witmotion"\nport = "/dev/ttyUSB-none"\n', "/dev/ttyUSB-none"),
    "missing bus": ('[device]\nkind = "adxl355"\nbus = 77\n', "/dev/i2c-77"),
    "missing recording": ('[device]\nkind = "replay"\npath = "/none.csv"\n', "/none.csv"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_configurations_are_refused_at_start(start_gateway: StartGateway, case: str) -> None:
    toml, expected = REFUSED[case]
    gateway = start_gateway(toml)
    code, out, err = gateway.wait()
    assert code == 2
    assert expected in one_line(err)
    assert out == ""
    assert gateway.recordings == []


def test_second_instance_on_the_same_data(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    first = start_gateway()
    join_bus(first.endpoint).wait_for("health")
    second = start_gateway()
    code, _, err = second.wait()
    assert code == 2
    assert f"in use by another gateway (process {first.process.pid})" in one_line(err)
    assert first.process.poll() is None


def test_a_full_disk_stops_the_recording_and_not_the_gateway(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    """The kernel's limit on file size stands in for a disk without room: writes fail at the outermost call."""
    gateway = start_gateway(
        "[device]\nodr_hz = 4000\nblock_samples = 32\n",
        prefix=("sh", "-c", 'ulimit -f 512; exec "$@"', "sh"),  # blocks of 512 bytes: 256 KiB, beyond the first sync
    )
    peer = join_bus(gateway.endpoint)
    said = peer.wait_for("health", lambda message: message["recording_error"])
    assert "recording to" in said["recording_error"]
    later = peer.wait_for("health", lambda message: message["faults"].get("samples_not_recorded", 0) > 0)
    assert later["state"] == "running"
    last_ns = peer.messages("tilt")[-1]["time_ns"]
    peer.wait_for("tilt", lambda message: message["time_ns"] > last_ns + 1e9)
    code, err = gateway.stop()
    assert code == 3
    assert "samples could not be recorded" in err
    for path in gateway.recordings:
        assert summarise(path).samples.count > 0  # what was written stays readable


CLI_REFUSED = {
    "record of nothing": (["record", "info", "none.mcap"], "none.mcap"),
    "record of text": (["record", "info", "pyproject.toml"], "pyproject.toml"),
    "measure of nothing": (["measure", "none.csv"], "none.csv"),
    "measure of other text": (["measure", "README.md"], "README.md"),
    "measure of one file twice": (["measure", "README.md", "README.md"], "README.md: is given twice"),
    "measure of a folder without recordings": (["measure", "docs"], "docs: contains no .mcap file"),
    "rig of nothing": (["measure", "README.md", "--rig", "none.toml"], "none.toml"),
    "check of nothing": (["config", "check", "none.toml"], "none.toml"),
    "unknown topic": (["config", "schema", "--topic", "nope"], "no topic 'nope'"),
}


@pytest.mark.parametrize("case", CLI_REFUSED)
def test_commands_refuse_bad_input_in_one_line(
    case: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    arguments, expected = CLI_REFUSED[case]
    assert main(arguments) == 2
    assert expected in one_line(capsys.readouterr().err)


def test_a_gateway_that_cannot_be_reached_is_no_usage_error(plumbline: Plumbline) -> None:
    done = plumbline("remote", "status", "--connect", "tcp/127.0.0.1:1")
    assert done.returncode == 1
    assert "nobody answers" in one_line(done.stderr)


def test_usage_errors_have_exit_code_two(plumbline: Plumbline) -> None:
    assert plumbline("run", "--duration", "-1").returncode == 2
    assert run_process("nonsense").returncode == 2
    nothing = run_process("record", "info", "none.mcap")
    assert (nothing.returncode, "none.mcap" in one_line(nothing.stderr)) == (2, True)
    refused = plumbline("measure", "README.md", "--from", "noon")
    assert refused.returncode == 2
    assert "argument --from: noon is neither seconds from the start" in one_line(refused.stderr.splitlines()[-1])


@pytest.mark.parametrize(
    "command",
    [
        [],
        ["run"],
        ["measure"],
        ["record"],
        ["record", "info"],
        ["record", "recover"],
        ["remote"],
        ["remote", "status"],
        ["remote", "watch"],
        ["remote", "align"],
        ["remote", "fetch"],
        ["config"],
        ["config", "show"],
        ["config", "check"],
        ["config", "schema"],
        ["doctor"],
    ],
)
def test_every_command_has_help_with_an_example(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main([*command, "--help"])
    assert "example" in capsys.readouterr().out
