"""A site with certificates: real gateways, the command line of people with certificates, and a hostile peer on the network."""

import json
import subprocess
import sys
import time
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
import zenoh

from gateway.bus.client import GatewayClient, open_client_session
from gateway.bus.credentials import Credentials, load_credentials
from gateway.bus.session import BusError, TlsFiles
from gateway.errors import InputError
from gateway.pki.site_folder import Holder, utc_now
from tests.gateway.pki.site import Site
from tests.ports import unused_port
from tests.system.bus_query import KEY, query, sign
from tests.system.conftest import ROOT, Completed, Plumbline, RunningGateway, StartGateway
from tests.values import present
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow


class TlsSite:
    """One gateway that listens with TLS alone."""

    def __init__(self, folder: Path, start_gateway: StartGateway, plumbline: Plumbline) -> None:
        self._plumbline = plumbline
        self.keys = Site(folder / "keys")
        self.certificate_toml = self.keys.gateway_toml()
        self.endpoint = f"tls/127.0.0.1:{unused_port()}"
        environment = {"PLUMBLINE_BUS__LISTEN": json.dumps([self.endpoint])}
        self.gateway: RunningGateway = start_gateway(self.certificate_toml, environment=environment)
        self.viewer = self.keys.issue("viewer", Holder.OPERATOR)
        wait_until(self._answers, "the gateway")

    def _answers(self) -> bool:
        assert self.gateway.process.poll() is None
        try:
            open_client_session(self.endpoint, load_credentials(self.viewer)).close()
        except BusError:
            return False
        return bool(self.status())

    def remote(self, folder: Path | None, *arguments: str) -> Completed:
        environment = {"XDG_STATE_HOME": str(self.keys.folder.path), "PLUMBLINE_CREDENTIALS": None}
        options = [] if folder is None else ["--credentials", str(folder)]
        return self._plumbline("remote", *arguments, "--connect", self.endpoint, *options, environment=environment)

    def status(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.remote(self.viewer, "status", "--json", "-").stdout or "{}").get(
            KEY, {}
        )
        return found

    def refused(self) -> dict[str, int]:
        counts: dict[str, int] = self.status()["health"]["refused"]
        return counts

    @property
    def is_suspended(self) -> bool:
        return "SUSPENDED" in self.status()["alert"]["text"]


@pytest.fixture
def site(tmp_path: Path, start_gateway: StartGateway, plumbline: Plumbline) -> TlsSite:
    return TlsSite(tmp_path, start_gateway, plumbline)


def test_each_role_may_do_its_part_and_the_name_is_that_of_the_certificate(site: TlsSite) -> None:
    ann, bob = site.keys.issue("ann", Holder.SERVICE), site.keys.issue("bob", Holder.OPERATOR)
    assert site.remote(bob, "mark", "sling slipped", "--by", "ann").returncode == 0
    refused = site.remote(bob, "recalibrate", "--by", "ann", "--housing-off-rope")
    assert (refused.returncode, "needs the role service" in refused.stderr) == (1, True)
    assert not site.is_suspended
    assert site.remote(ann, "cancel", "--by", "somebody else").returncode == 1  # nothing is active; the person may
    audit = (site.gateway.data_dir / "calibration" / "audit.jsonl").read_text().splitlines()
    assert [json.loads(line)["by"] for line in audit] == ["ann"]
    (entry,) = [json.loads(line) for line in (site.gateway.data_dir / "security.jsonl").read_text().splitlines()]
    assert (entry["name"], entry["kind"]) == ("bob", "wrong_role")
    assert "bob, tls/127.0.0.1:" in entry["origin"]
    assert site.status()["mark"]["by"] == "bob"


def test_a_revoked_certificate_commands_nothing_from_that_moment(site: TlsSite) -> None:
    ann = site.keys.issue("ann", Holder.SERVICE)
    assert "refused: no session is active" in site.remote(ann, "cancel", "--by", "ann").stderr
    site.keys.folder.revoke("ann", utc_now())
    refused = site.remote(ann, "recalibrate", "--by", "ann", "--housing-off-rope")
    assert (refused.returncode, "was revoked" in refused.stderr) == (1, True)
    assert not site.is_suspended
    wait_until(lambda: site.refused() == {"revoked_certificate": 1}, "the count of the refusal in health")


def test_without_a_valid_certificate_of_the_site_nobody_gets_a_link(site: TlsSite, tmp_path: Path) -> None:
    ann = site.keys.issue("ann", Holder.SERVICE)
    other = Site(tmp_path / "other").issue("ann", Holder.SERVICE)
    nobody = TlsFiles(ann / "ca.pem", None, None)
    stranger = TlsFiles(ann / "ca.pem", other / "certificate.pem", other / "key.pem")
    expired = load_credentials(site.keys.expired("old", Holder.SERVICE)).tls
    for tls in (nobody, stranger, expired):
        with pytest.raises(BusError):
            open_client_session(site.endpoint, Credentials([], tls))
    with pytest.raises(BusError):
        open_client_session(site.endpoint.replace("tls/", "tcp/"), Credentials([]))
    without = site.remote(None, "status")
    assert (without.returncode, without.stderr.count("\n"), "--credentials" in without.stderr) == (2, 1, True)
    assert open_client_session(site.endpoint, load_credentials(ann)).close() is None


def test_an_operators_certificate_forges_and_replays_nothing(site: TlsSite) -> None:
    bob, ann = site.keys.issue("bob", Holder.OPERATOR), site.keys.issue("ann", Holder.SERVICE)
    seen: list[bytes] = []
    viewer = open_client_session(site.endpoint, load_credentials(site.viewer))
    viewer.declare_subscriber("plumbline/v1/**", lambda sample: seen.append(sample.payload.to_bytes()))
    hostile = open_client_session(site.endpoint, load_credentials(bob))
    for topic in ("alert", "health", "swing", "condition", "calibration", "samples", "tilt", "motion", "mark", "*"):
        hostile.put(f"{KEY}/{topic}", b"forged")
    captured = _signed_cancel(hostile, ann)
    first, again = (_ask(hostile, *captured) for _ in range(2))
    assert "no session is active" in first
    assert "was used before" in again
    wait_until(lambda: len(seen) > 20, "true messages after the forged ones")
    assert b"forged" not in seen
    wait_until(lambda: site.refused() == {"replayed_credential": 1}, "the count of the refusal in health")
    viewer.close()
    hostile.close()


def _signed_cancel(session: zenoh.Session, folder: Path) -> tuple[bytes, bytes]:
    """A request that somebody with the right to it has signed, as a peer on the way would capture it."""
    payload = b'{"id": "captured-1", "by": "ann"}'
    return payload, sign(session, "cancel", payload, folder)


def _ask(session: zenoh.Session, payload: bytes, attachment: bytes) -> str:
    ((accepted, content),) = query(session, "cancel", payload, attachment)
    assert not accepted
    return str(content["reason"])


def test_names_on_the_link_restrict_who_may_read_and_send_the_load_signal(
    tmp_path: Path, start_gateway: StartGateway
) -> None:
    keys = Site(tmp_path / "keys")
    endpoint = f"tls/127.0.0.1:{unused_port()}"
    access = '[bus.access]\noperators = ["bob"]\nservices = ["ann"]\nload_signals = ["cell"]\n'
    start_gateway(keys.gateway_toml() + access, environment={"PLUMBLINE_BUS__LISTEN": json.dumps([endpoint])})
    folders = {name: keys.issue(name, Holder.OPERATOR) for name in ("bob", "eve")}

    def reads(name: str) -> bool:
        try:
            with open_client_session(endpoint, load_credentials(folders[name])) as session:
                return any(reply.ok for reply in session.get(f"{KEY}/rpc/status", timeout=2.0))
        except BusError:
            return False

    wait_until(lambda: reads("bob"), "an answer for bob")
    assert not reads("eve")


def test_through_a_router_commands_stay_authorised_and_an_operator_forges_nothing(
    tmp_path: Path, start_gateway: StartGateway
) -> None:
    keys = Site(tmp_path / "keys")
    endpoint = f"tls/127.0.0.1:{unused_port()}"
    environment = {"PLUMBLINE_BUS__MODE": "client", "PLUMBLINE_BUS__CONNECT": json.dumps([endpoint])}
    start_gateway(keys.gateway_toml(), environment=environment)  # the router is down at the start
    files, names = keys.folder.issue("router-1", Holder.ROUTER, [], 30, utc_now()), tmp_path / "gateways.txt"
    names.write_text("demo-site/crane-1/hook-1 crane-1\n")
    options = [f"--{name}={files / f'{name}.pem'}" for name in ("ca", "certificate", "key")]
    readers = ["--reader=ann", "--reader=bob", f"--gateways={names}"]
    command = [sys.executable, "-m", "gateway", "fleet", "router", f"--listen={endpoint}", *options, *readers]
    folders = {name: keys.issue(name, holder) for name, holder in (("ann", Holder.SERVICE), ("bob", Holder.OPERATOR))}
    for _ in range(2):  # the second router is started after the first one was killed
        router = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            for name, reason in (("ann", "no session is active"), ("bob", "needs the role service")):
                assert reason in _answer_to_cancel(endpoint, folders[name])
            _forge_through(endpoint, folders)
        finally:
            router.kill()
            router.wait()


def _answer_to_cancel(endpoint: str, folder: Path) -> str:
    clients: list[GatewayClient] = []

    def is_connected() -> bool:
        with suppress(BusError, InputError):
            clients.append(GatewayClient(endpoint, KEY, load_credentials(folder)))
        return bool(clients)

    wait_until(is_connected, "the gateway behind the router")
    with closing(clients[0]) as client:
        return present(client.ask("cancel", {"id": f"request-{time.time_ns()}", "by": "x"}, PATIENCE_S)).text


def _forge_through(endpoint: str, folders: dict[str, Path]) -> None:
    seen: list[bytes] = []
    viewer, hostile = (open_client_session(endpoint, load_credentials(folders[name])) for name in ("ann", "bob"))
    viewer.declare_subscriber("plumbline/v1/**", lambda sample: seen.append(sample.payload.to_bytes()))
    for topic in ("alert", "health", "*"):
        hostile.put(f"{KEY}/{topic}", b"by eve")
    wait_until(lambda: len(seen) > 20, "true messages after the forged ones")
    assert b"by eve" not in seen
    viewer.close()
    hostile.close()


def test_doctor_asks_with_the_certificate_of_the_gateway_and_else_says_whose_it_needs(
    site: TlsSite, tmp_path: Path, plumbline: Plumbline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PLUMBLINE_CREDENTIALS", raising=False)
    settings = f'[gateway]\ndata_dir = "{site.gateway.data_dir}"\n[bus]\nlisten = ["{site.endpoint}"]\n[page]\nenabled = false\n'
    config, elsewhere = tmp_path / "doctor.toml", tmp_path / "elsewhere.toml"
    config.write_text(settings + site.certificate_toml)
    elsewhere.write_text(settings + site.certificate_toml.replace("key.pem", "of-another-user.pem"))

    asked, not_asked = (plumbline("doctor", "--config", path) for path in (config, elsewhere))
    monkeypatch.setenv("PLUMBLINE_CREDENTIALS", str(site.viewer))
    as_viewer = plumbline("doctor", "--config", elsewhere)

    assert "ok   gateway      has been running" in asked.stdout
    assert f"note gateway      runs with {site.gateway.data_dir}, and was not asked" in not_asked.stdout
    assert "in PLUMBLINE_CREDENTIALS" in not_asked.stdout
    assert "--credentials" not in not_asked.stdout
    assert "ok   gateway      has been running" in as_viewer.stdout
    for done in (asked, not_asked, as_viewer):
        assert ("BAD" in done.stdout, done.returncode) == (False, 0), done.stdout
