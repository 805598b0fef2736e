"""Settings and options that cannot be used are told in one line, before anything is opened."""

from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.errors import BAD_INPUT
from tests.system.opcua_site import issue

KEY = "plumbline/v1/yard/crane-1/hook"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("toml", "why"),
    [
        ("[modbuss]\n", "modbuss: unknown key; did you mean modbus?"),
        ("[modbus]\nport = 502\n", "modbus.port: unknown key; known are listen, clients, max_connections, idle_s"),
        ('[modbus]\nclients = ["10.0.0.7/8"]\n', "modbus.clients.0: 10.0.0.7/8 has host bits set"),
        ("\ufeff[modbus]\nidle_s = 0\n", "modbus.idle_s: Input should be greater than 0"),
        ('[mqtt]\nposition_file = "{folder}/nowhere/position.json"\n', "/nowhere is no folder; make it"),
        ('[modbus]\nlisten = "5020"\n', "modbus.listen: 5020 is not an address with a port"),
        ("[modbus]\nmax_connections = 0\n", "modbus.max_connections"),
        ("[mqtt\n", "config/bridge.toml is an example"),
        ('[mqtt]\nhost = "10.0.0.9"\n', "10.0.0.9 is reached without TLS; set ca, or allow_unencrypted = true"),
        ('[mqtt]\npassword_file = "secret"\n', "password_file needs user"),
        ('[mqtt]\ncertificate = "a.pem"\n', "certificate and key belong together, and need ca"),
        ('[mqtt]\nprefix = "a/#"\n', "mqtt.prefix"),
        ('[mqtt]\nuser = "crane"\npassword_file = "/nowhere"\n', "mqtt.password_file: /nowhere: cannot be read"),
        ('[mqtt]\nca = "/nowhere"\n', "mqtt.ca, certificate and key cannot be used"),
        ('[mqtt]\nposition_file = "{folder}/bridge.toml"\n', "bridge.toml: is no position among the alerts; delete it"),
    ],
)
def test_a_wrong_setting_is_told_in_one_line(
    toml: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "bridge.toml"
    settings.write_text(toml.replace("{folder}", str(tmp_path)))
    connect = ("--connect", "tcp/127.0.0.1:1")
    assert main(["bridge", "mqtt", "--settings", str(settings), "--gateway", KEY, *connect]) == BAD_INPUT
    said = capsys.readouterr().err
    assert why in said
    assert said.startswith("plumbline bridge: ")
    assert said.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("key", ["plumbline/v1/*/*/*", "plumbline/v1/yard", "crane"])
def test_a_bridge_has_one_gateway(key: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bridge", "modbus", "--gateway", key]) == BAD_INPUT
    assert "a bridge has one gateway, plumbline/v1/<site>/<crane>/<sensor>" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("toml", "why"),
    [
        ("", "opcua.trusted is needed"),
        ('[opcua]\ntrusted = "{folder}"\n', "opcua.certificate and opcua.key are needed"),
        ('[opcua]\nuser = "ann"\n', "user and password_file belong together"),
    ],
)
def test_opc_ua_is_not_served_without_certificates(
    toml: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "bridge.toml"
    settings.write_text(toml.replace("{folder}", str(tmp_path)))
    issue(tmp_path, "client")
    (tmp_path / "client-key.pem").unlink()
    arguments = ("--settings", str(settings), "--gateway", KEY, "--connect", "tcp/127.0.0.1:1")
    assert main(["bridge", "opcua", *arguments]) == BAD_INPUT
    assert why in capsys.readouterr().err


def test_a_file_that_is_not_there_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bridge", "modbus", "--settings", "/nowhere.toml", "--gateway", KEY]) == BAD_INPUT
    assert "/nowhere.toml: No such file or directory" in capsys.readouterr().err
