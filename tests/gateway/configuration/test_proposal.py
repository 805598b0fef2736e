"""Proposals over the bus: comments stay, the difference is complete, and what only the machine may change is refused."""

import tomllib

import pytest

from gateway.configuration.loading import ConfigurationError
from gateway.configuration.model import Configuration
from gateway.configuration.proposal import REMOTE_KEYS, Table, check_proposal, visible_part

FILE = """\
# the yard crane
[gateway]
site = "yard"
data_dir = "/srv/secret-place"

[rope]
length_m = 20.0             # measured by ann

[housing]
position_m = 5.0            # from the pivot

[recorder]
key = "/etc/plumbline/key.pem"
quota_mb = 100

[bus.tls]
ca = "/etc/plumbline/ca.pem"
certificate = "/etc/plumbline/certificate.pem"
key = "/etc/plumbline/tls.pem"
"""


def _check(proposal: Table, *, allow_network: bool = False) -> tuple[str, list[str]]:
    checked = check_proposal(FILE, proposal, allow_network=allow_network, environment={})
    return checked.text, [str(change) for change in checked.changes]


@pytest.mark.slow
def test_a_change_keeps_comments_and_all_other_keys() -> None:
    text, changes = _check({"rope": {"length_m": 21.5}})
    assert changes == ["rope.length_m: 20.0 -> 21.5"]
    assert text == FILE.replace("20.0 ", "21.5 ")


def test_a_key_that_a_section_no_longer_states_is_removed() -> None:
    text, changes = _check({"housing": {"above_load_m": 2.5}})
    assert changes == ["housing.position_m: 5.0 -> not given", "housing.above_load_m: not given -> 2.5"]
    assert "position_m" not in text
    assert tomllib.loads(text)["rope"] == {"length_m": 20.0}


def test_a_section_keeps_what_only_the_machine_may_change() -> None:
    text, changes = _check({"recorder": {"quota_mb": 2000}})
    assert changes == ["recorder.quota_mb: 100.0 -> 2000.0"]
    assert tomllib.loads(text)["recorder"] == {"key": "/etc/plumbline/key.pem", "quota_mb": 2000}


def test_a_new_section_is_added() -> None:
    text, changes = _check({"alerts": {"trip_deg": 5.0}})
    assert changes == ["alerts.trip_deg: 6.0 -> 5.0"]
    assert tomllib.loads(text)["alerts"] == {"trip_deg": 5.0}


@pytest.mark.parametrize(
    ("proposal", "why"),
    [
        ({"recorder": {"key": "/tmp/key"}}, "recorder.key: can only be changed on the gateway's own machine"),
        ({"device": {"power_cycle_command": ["sh"]}}, "device.power_cycle_command: can only be changed"),
        ({"device": {"bus_clear_command": ["sh"]}}, "device.bus_clear_command: can only be changed"),
        ({"device": {"kind": "replay", "path": "/etc/shadow"}}, "device.path: can only be changed"),
        ({"alrts": {"trip_deg": 5.0}}, "alrts: unknown key; did you mean alerts?"),
        ({"gateway": {"data_dir": "/"}}, "gateway.data_dir: can only be changed"),
        ({"gateway": {"demonstration": True}}, "gateway.demonstration: can only be changed"),
        ({"bus": {"tls": {"key": "/tmp/k"}}}, "bus.tls: can only be changed"),
        ({"alerts": {"trip_deg": 1.0}}, "clear_deg 3 <= warn_deg 4 <= trip_deg 1 must hold"),
        ({"rope": {"lenght_m": 1.0}}, "did you mean length_m"),
        ({"rope": {"length_m": 20.0}}, "changes nothing"),
        ({"bus": {"listen": ["tls/0.0.0.0:7447"]}}, "bus.listen: a wrong value cuts the gateway off"),
        ({"page": {"listen": "0.0.0.0:80"}}, "page.listen: a wrong value cuts the gateway off"),
        ({"gateway": {"site": "mine"}}, "gateway.site: a wrong value cuts the gateway off"),
        ({"bus": {"allow_unencrypted": True}}, "bus.allow_unencrypted: can only be changed"),
        ({"recorder": {"quota_mb": 0.001}}, "recorder.quota_mb: 0.001 is not between 1000 and"),
        ({"alerts": {"trip_deg": 89.9}}, "alerts.trip_deg: 89.9 is not between 0 and 15"),
        ({"filter": {"cutoff_hz": 1e-6}}, "filter.cutoff_hz: 1e-06 is not between 0.1 and 100"),
        ({"alerts": {"lean_trip_deg": 80}}, "alerts.lean_trip_deg: 80 is not between 0 and 15"),
        ({"alerts": {"hold_s": 600}}, "alerts.hold_s: 600 is not between 0.5 and 60"),
        ({"alerts": {"stale_s": 60}}, "alerts.stale_s: 60 is not between 0.2 and 5"),
        ({"alerts": {"hold_s": 600, "stale_s": 60}}, "own machine; alerts.stale_s: 60 is not between 0.2 and 5"),
        ({"rope": {"length_m": 0.1}, "housing": {"position_m": 0.05}}, "rope.length_m: 0.1 is not between 0.3 and 500"),
        ({"bus": {"listen": ["tls/0.0.0.0:7447#enable_mtls=false"]}}, "has parameters"),
        ({"nonsense": 1}, "nonsense: unknown key; known are gateway"),
    ],
)
def test_refusals_name_key_and_remedy(proposal: Table, why: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        _check(proposal)
    assert why in str(caught.value)


def test_network_keys_need_a_permission_and_then_change() -> None:
    text, changes = _check({"bus": {"listen": ["tls/0.0.0.0:7447"]}}, allow_network=True)
    assert changes == ["bus.listen: ['tcp/127.0.0.1:7447'] -> ['tls/0.0.0.0:7447']"]
    assert tomllib.loads(text)["bus"]["tls"]["key"] == "/etc/plumbline/tls.pem"


@pytest.mark.parametrize("key", ["listen", "connect"])
def test_an_endpoint_that_names_a_file_is_refused_even_with_the_permission_for_network_keys(key: str) -> None:
    with pytest.raises(ConfigurationError, match=f"bus.{key}: unixsock-stream//etc/passwd names a file"):
        _check({"bus": {key: ["unixsock-stream//etc/passwd"]}}, allow_network=True)


def test_a_network_key_that_the_environment_overrides_still_needs_a_permission() -> None:
    environment = {"PLUMBLINE_BUS__LISTEN": '["tcp/127.0.0.1:1"]'}
    with pytest.raises(ConfigurationError, match="cuts the gateway off"):
        check_proposal(FILE, {"bus": {"listen": ["tcp/127.0.0.1:9447"]}}, allow_network=False, environment=environment)


def test_what_can_be_read_contains_no_file_and_no_command() -> None:
    everything = Configuration.model_validate({"device": {"kind": "adxl355"}}).model_dump(mode="json")
    everything["mqtt"] = {"password": "secret"}
    visible = visible_part(everything)
    names = {f"{section}.{key}" for section, keys in visible.items() for key in keys}
    assert "alerts.trip_deg" in names
    hidden = {"recorder.key", "gateway.data_dir", "device.bus_clear_command", "device.power_cycle_command", "bus.tls"}
    assert not names & (hidden | {"mqtt.password"})


def test_every_remote_section_is_one_of_the_configuration() -> None:
    assert set(REMOTE_KEYS) <= set(Configuration.model_fields)
