"""The section of the bus: what is open to the network needs certificates, and endpoints have a form."""

from typing import Any

import pytest
from pydantic import ValidationError

from gateway.configuration.bus_section import BusSection, is_loopback

TLS = {"ca": "ca.pem", "certificate": "certificate.pem", "key": "key.pem"}


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ({"listen": ["tcp/0.0.0.0:7447"]}, "open to the network without certificates"),
        ({"listen": ["tcp/127.0.0.1:7447", "ws/10.0.0.5:8000"]}, "ws/10.0.0.5:8000 is open"),
        ({"listen": ["tcp/0.0.0.0:7447"], "tls": TLS}, "open to the network without certificates"),
        ({"listen": ["tls/0.0.0.0:7447"]}, "tls/0.0.0.0:7447 needs bus.tls.ca"),
        ({"mode": "client", "connect": ["tls/10.0.0.1:7447"]}, "needs bus.tls.ca"),
        ({"mode": "client"}, "needs bus.connect"),
        ({"tls": {"ca": "ca.pem"}}, "bus.tls.certificate and bus.tls.key missing"),
        ({"tls": {"revoked": "revoked.pem"}}, "bus.tls.revoked needs"),
        ({"listen": ["7447"]}, "is not an endpoint"),
        ({"listen": ["tcp/127.0.0.1:99999"]}, "is not an endpoint"),
        ({"connect": ["tcp/10.0.0.1"]}, "is not an endpoint"),
        ({"connect": ["http/10.0.0.1:80"]}, "is not an endpoint"),
        ({"listen": ["tls/0.0.0.0:7447#enable_mtls=false"], "tls": TLS}, "has parameters"),
        ({"connect": ["tls/10.0.0.1:7447#verify_name_on_connect=false"], "tls": TLS}, "has parameters"),
        ({"listen": ["tcp/127.0.0.1:7447?rel=0"]}, "has parameters"),
        ({"listen": ["unixsock-stream//run/plumbline.sock#a=b"]}, "has parameters"),
        ({"forward": ["plumbline/**"]}, "pattern"),
    ],
)
def test_an_unsafe_or_malformed_section_is_refused_with_the_remedy(section: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said.replace(".", r"\.")):
        BusSection.model_validate(section)


@pytest.mark.parametrize(
    "section",
    [
        {},
        {"listen": ["tls/0.0.0.0:7447", "tcp/127.0.0.1:7447"], "tls": TLS},
        {"listen": ["tcp/0.0.0.0:7447"], "allow_unencrypted": True},
        {"mode": "client", "connect": ["tcp/10.0.0.1:7447"]},
        {"listen": ["unixsock-stream//run/plumbline.sock", "tcp/[::1]:7447", "tcp/localhost:7447"]},
        {"mode": "client", "listen": ["tcp/0.0.0.0:7447"], "connect": ["tcp/[fe80::1]:7447"]},
    ],
)
def test_a_safe_section_is_accepted(section: dict[str, Any]) -> None:
    BusSection.model_validate(section)


def test_a_process_of_this_machine_uses_the_loopback_listener_or_the_router_of_a_client() -> None:
    both = BusSection.model_validate({"listen": ["tls/10.0.0.5:7447", "tcp/127.0.0.1:7448"], "tls": TLS})
    assert both.local_endpoints[0] == "tcp/127.0.0.1:7448"
    everywhere = BusSection.model_validate({"listen": ["tls/0.0.0.0:7447"], "tls": TLS})
    assert everywhere.local_endpoints == ["tls/127.0.0.1:7447"]
    client = BusSection.model_validate({"mode": "client", "connect": ["tcp/10.0.0.1:7447"]})
    assert client.local_endpoints == ["tcp/10.0.0.1:7447"]


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1.evil.org:1", "tcp/localhost.evil.org:1", "tcp/10.0.0.127:1"])
def test_a_name_that_begins_like_loopback_is_not(endpoint: str) -> None:
    assert not is_loopback(endpoint)
