"""The access control of a fleet's router, tried by parties with certificates of the site."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization

from gateway.bus.session import BusError, TlsFiles, open_session
from gateway.pki.site_folder import Holder, KeyPair, issue, make_authority
from tests.ports import unused_port
from tests.system.conftest import Plumbline, RunningGateway
from tests.system.test_fleet_router import CONNECT_MS, OWN, Router, stored
from tests.waiting import wait_until

OTHER = "plumbline/v1/yard/c2/hook"


class Certificates:
    """A site's CA with certificates of all parties."""

    def __init__(self, folder: Path) -> None:
        self._folder, now = folder, datetime.now(UTC)
        self._authority = make_authority("yard", 10, now)
        self._write("ca", self._authority)
        for name, holder in (
            ("router", Holder.ROUTER),
            ("c1", Holder.GATEWAY),
            ("ann", Holder.OPERATOR),
            ("stranger", Holder.OPERATOR),
        ):
            self._write(name, issue(self._authority, name, holder, (), 10, now))

    def _write(self, name: str, pair: KeyPair) -> None:
        pem = serialization.Encoding.PEM
        key = pair.key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
        (self._folder / f"{name}.pem").write_bytes(pair.certificate.public_bytes(pem))
        (self._folder / f"{name}-key.pem").write_bytes(key)

    def of(self, name: str) -> TlsFiles:
        return TlsFiles(self._folder / "ca.pem", self._folder / f"{name}.pem", self._folder / f"{name}-key.pem")


@pytest.fixture
def certificates(tmp_path: Path) -> Certificates:
    return Certificates(tmp_path)


@pytest.fixture
def router(certificates: Certificates, tmp_path: Path) -> Iterator[Router]:
    gateways = tmp_path / "gateways.txt"
    gateways.write_text("yard/c1/hook\nyard/c2/hook second\n")
    files = certificates.of("router")
    running = Router(
        f"tls/127.0.0.1:{unused_port()}", "--gateways", gateways, "--reader", "ann",
        "--ca", files.ca, "--certificate", str(files.certificate), "--key", str(files.key),
    )  # fmt: skip
    yield running
    assert running.stop() == 0


@pytest.mark.slow
def test_each_party_may_do_what_its_certificate_allows(router: Router, certificates: Certificates) -> None:
    gateway, ann, stranger = (
        open_session("client", [router.endpoint], [], certificates.of(name), CONNECT_MS)
        for name in ("c1", "ann", "stranger")
    )
    heard: list[tuple[str, bytes]] = []
    ann.declare_subscriber(
        "plumbline/v1/**", lambda sample: heard.append((str(sample.key_expr), sample.payload.to_bytes()))
    )
    strange: list[str] = []
    stranger.declare_subscriber("plumbline/v1/**", lambda sample: strange.append(str(sample.key_expr)))
    alive: list[str] = []
    ann.liveliness().declare_subscriber(
        "plumbline/v1/*/*/*/alive", lambda sample: alive.append(f"{sample.kind} {sample.key_expr}"), history=True
    )
    gateway.declare_queryable(f"{OWN}/rpc/status", lambda query: query.reply(f"{OWN}/rpc/status", b"own"))
    token = gateway.liveliness().declare_token(f"{OWN}/alive")
    gateway.liveliness().declare_token(f"{OTHER}/alive")
    for key in (f"{OTHER}/alert", "plumbline/v1/**", "plumbline/v1/yard/*/hook/alert"):
        gateway.put(key, b"forged")
    stranger.put(f"{OWN}/alert", b"forged")
    wait_until(lambda: gateway.put(f"{OWN}/alert", b"true") or (f"{OWN}/alert", b"true") in heard, "a true alert")
    assert {payload for _, payload in heard} == {b"true"}
    assert {key for key in strange if key != f"{OWN}/alert"} == set()
    assert strange.count(f"{OWN}/alert") <= 1  # its own, which never left its session
    assert stored(ann, "plumbline/v1/*/*/*/rpc/status") == [b"own"]
    assert stored(stranger, "plumbline/v1/*/*/*/rpc/status") == []
    wait_until(lambda: stored(ann, "plumbline/v1/*/*/*/alert") == [b"true"], "the alert in the router")
    token.undeclare()
    wait_until(lambda: len(alive) >= 2, "the end of the token")
    assert [text.split()[-1] for text in alive] == [f"{OWN}/alive"] * 2
    with pytest.raises(BusError):
        open_session("client", [router.endpoint], [], TlsFiles(certificates.of("ann").ca, None, None), 1000)
    for session in (gateway, ann, stranger):
        session.close()


@pytest.mark.slow
def test_a_gateway_behind_a_router_is_listed_and_commanded_by_certificates(
    tmp_path: Path, plumbline: Plumbline
) -> None:
    keys = tmp_path / "keys"
    for arguments in (
        ("init", "--site", "yard"),
        ("issue", "router", "router", "--host", "127.0.0.1"),
        ("issue", "gateway", "c1"),
        ("issue", "operator", "ann"),
    ):
        made = plumbline("keys", *arguments, "--folder", keys)
        assert made.returncode == 0, made.stderr
    gateways = tmp_path / "gateways.txt"
    gateways.write_text("yard/c1/hook\n")
    endpoint, own = f"tls/127.0.0.1:{unused_port()}", keys / "router-router"
    router = Router(
        endpoint, "--gateways", gateways, "--reader", "ann",
        "--ca", own / "ca.pem", "--certificate", own / "certificate.pem", "--key", own / "key.pem",
    )  # fmt: skip
    files = "\n".join(
        f'{key} = "{keys / "gateway-c1" / name}.pem"'
        for key, name in (("ca", "ca"), ("certificate", "certificate"), ("key", "key"))
    )
    toml = (
        '[gateway]\nsite = "yard"\ncrane = "c1"\nsensor = "hook"\n'
        f'[bus]\nmode = "client"\nconnect = ["{endpoint}"]\n[bus.tls]\n{files}\n'
        "[alerts]\nwarn_deg = 80\ntrip_deg = 85\nclear_deg = 70\nlean_trip_deg = 80\n"
    )
    gateway = RunningGateway(tmp_path, toml)
    ann = ("--connect", endpoint, "--credentials", str(keys / "operator-ann"))
    try:

        def is_well() -> bool:
            return (
                plumbline("fleet", "status", *ann, "--expect", gateways, "--accept", "disturbed,unknown").returncode
                == 0
            )

        wait_until(is_well, "the gateway in the list")
        marked = plumbline("remote", "mark", "sling slipped", "--by", "ann", *ann)
        assert marked.returncode == 0, marked.stderr
        refused = plumbline("remote", "cancel", "--by", "ann", "--reason", "none", *ann)
        assert refused.returncode != 0  # an operator may mark, and not recalibrate
        assert plumbline("fleet", "status", "--connect", endpoint, "--credentials", tmp_path).returncode == 2
    finally:
        gateway.process.kill()
        gateway.process.communicate()
        assert router.stop() == 0
