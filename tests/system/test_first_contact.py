"""On a site with a CA the first contact is authentic, whoever stands between; and so are recordings, by the CA alone."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from gateway.pki.site_folder import Holder, utc_now
from tests.gateway.pki.site import Site
from tests.ports import unused_port
from tests.system.conftest import Plumbline, RunningGateway, StartGateway
from tests.system.test_forged_messages import forger
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

KEY = "plumbline/v1/yard/crane-1/hook-1"
YARD = '[gateway]\nsite = "yard"\ncrane = "crane-1"\n'


class User:
    """Somebody with a certificate, who has heard of no gateway yet."""

    def __init__(self, credentials: Path, home: Path, plumbline: Plumbline) -> None:
        environment = {"XDG_STATE_HOME": str(home), "PLUMBLINE_CREDENTIALS": str(credentials)}
        self.run = partial(plumbline, environment=environment)
        self.pins = home / "plumbline" / "gateways"

    def card(self, endpoint: str) -> Any:
        shown = self.run("fleet", "status", "--connect", endpoint, "--json", "-").stdout
        return next(iter(json.loads(shown or "{}").get("gateways", [])), None)


class YardSite:
    """A gateway that listens with TLS, and people of the site."""

    def __init__(self, folder: Path, start_gateway: StartGateway, plumbline: Plumbline) -> None:
        self.keys = Site(folder / "keys")
        self.endpoint = f"tls/127.0.0.1:{unused_port()}"
        environment = {"PLUMBLINE_BUS__LISTEN": json.dumps([self.endpoint]), "XDG_STATE_HOME": str(folder / "gateway")}
        self.gateway: RunningGateway = start_gateway(YARD + self.keys.gateway_toml(), environment=environment)
        self._folder, self._plumbline = folder, plumbline

    def user(self, name: str) -> User:
        return User(self.keys.issue(name, Holder.SERVICE), self._folder / f"home-of-{name}", self._plumbline)


@pytest.fixture
def site(tmp_path: Path, start_gateway: StartGateway, plumbline: Plumbline) -> YardSite:
    return YardSite(tmp_path, start_gateway, plumbline)


def test_a_router_that_says_it_is_the_gateway_is_believed_by_nobody(site: YardSite, tmp_path: Path) -> None:
    ann, bob = site.user("ann"), site.user("bob")
    status = "remote", "status", "--connect", site.endpoint, "--json", "-"
    wait_until(lambda: "health" in json.loads(ann.run(*status).stdout or "{}").get(KEY, {}), "the gateway")
    told = ann.run(*status)
    assert told.stderr == ""
    assert list(ann.pins.iterdir())
    topics = {name: value for name, value in json.loads(told.stdout)[KEY].items() if name != "drift"}
    (tmp_path / "status.json").write_text(json.dumps(topics))

    router = site.keys.folder.issue("router-1", Holder.ROUTER, [], 30, utc_now())
    elsewhere = f"tls/127.0.0.1:{unused_port()}"
    posed = "remote", "status", "--connect", elsewhere
    with forger("pose", elsewhere, KEY, router, tmp_path / "status.json"):
        first = bob.run(*posed)
        assert first.returncode == 0
        assert "NOT AUTHENTICATED: the site's CA does not vouch for the key" in first.stderr
        assert "is not that of a gateway, but that of router router-1" in first.stderr
        assert bob.card(elsewhere)["authenticated"] is False
        assert "NOT AUTHENTICATED" in bob.run("remote", "mark", "x", "--by", "bob", "--connect", elsewhere).stderr
        assert not bob.pins.exists()
        assert bob.card(site.endpoint)["authenticated"] is True  # the true gateway, for the first time
        assert bob.run(*status).stderr == ""
        assert "is pinned" in bob.run(*posed).stderr
        assert bob.run("remote", "mark", "x", "--by", "bob", "--connect", elsewhere).returncode == 1
        assert ann.card(elsewhere)["authenticated"] is False


def test_the_recordings_of_a_gateway_with_a_certificate_are_genuine_by_the_ca_alone(
    site: YardSite, tmp_path: Path
) -> None:
    ann = site.user("ann")
    wait_until(lambda: site.gateway.recordings, "a recording")
    site.gateway.stop()
    folder = site.gateway.data_dir
    assert ann.run("record", "verify", folder).returncode == 3
    verified = ann.run("record", "verify", folder, "--ca", site.keys.folder.path / "ca.pem")
    assert (verified.returncode, "vouches for the key" in verified.stdout) == (0, True), verified.stdout
    other = Site(tmp_path / "other")
    refused = ann.run("record", "verify", folder, "--ca", other.folder.path / "ca.pem")
    assert (refused.returncode, "not issued by this site's CA" in refused.stdout) == (1, True), refused.stdout
