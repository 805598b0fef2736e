"""The certificate scheme: whose signature is accepted, for what, and for which key of which gateway the site's CA vouches."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gateway.authorization.authoriser import Authoriser, SignedRequest
from gateway.authorization.caller import Caller, NotAuthorised, Role
from gateway.authorization.certificates import CertificateVerifier, SiteAuthority
from gateway.authorization.credential import prove_by_token
from gateway.bus.credentials import load_credentials
from gateway.pki.inspect import CertificateError, parse_authorities, revoked_serials
from gateway.pki.signing_key import SigningKey
from gateway.pki.site_folder import Holder, utc_now
from tests.gateway.pki.site import DAYS, Site
from tests.gateway.pki.site import vouch as make

BOOT = "0123456789ab"
KEY = "plumbline/v1/a/b/c/rpc/cancel"
PAYLOAD = b'{"id": "request-1", "by": "somebody else"}'
NOW_NS = 1_767_225_600_000_000_000


class Gateway:
    """The authoriser of a gateway of a site, with a wall clock that a test turns."""

    def __init__(self, folder: Path) -> None:
        self.site = Site(folder)
        self._revoked_file = self.site.folder.path / "revoked.pem"
        self._authorities = parse_authorities((self.site.folder.path / "ca.pem").read_bytes())
        self.wall: Callable[[], datetime] = utc_now
        verifier = CertificateVerifier(self._authorities, self.revoked, self._read_wall)
        self.authoriser = Authoriser(BOOT, verifier)

    def _read_wall(self) -> datetime:
        return self.wall()

    def revoked(self) -> frozenset[int]:
        return revoked_serials(self._revoked_file.read_bytes(), self._authorities)

    def ask(self, folder: Path, role: Role = Role.SERVICE, payload: bytes = PAYLOAD) -> Caller:
        attachment = load_credentials(folder).prove(KEY, PAYLOAD, self.authoriser.challenge(NOW_NS))
        return self.authoriser.admit(SignedRequest(KEY, payload, attachment), role, NOW_NS)

    def refusal(self, folder: Path, role: Role = Role.SERVICE, payload: bytes = PAYLOAD) -> tuple[str, str | None]:
        with pytest.raises(NotAuthorised) as caught:
            self.ask(folder, role, payload)
        return caught.value.kind, caught.value.name


@pytest.fixture
def gateway(tmp_path: Path) -> Gateway:
    return Gateway(tmp_path / "keys")


def test_the_name_of_the_certificate_is_the_callers(gateway: Gateway) -> None:
    ann = gateway.site.issue("ann", Holder.SERVICE)
    caller = gateway.ask(ann)
    assert caller == Caller("ann", Role.SERVICE, "certificate", caller.asked_ns)


def test_an_operator_may_acknowledge_and_not_recalibrate(gateway: Gateway) -> None:
    bob = gateway.site.issue("bob", Holder.OPERATOR)
    assert gateway.refusal(bob) == ("wrong_role", "bob")
    gateway.authoriser = Authoriser(BOOT, gateway.authoriser._proof)
    assert gateway.ask(bob, Role.OPERATOR).name == "bob"


@pytest.mark.parametrize("holder", [Holder.GATEWAY, Holder.ROUTER])
def test_a_stolen_gateway_or_router_commands_nothing(gateway: Gateway, holder: Holder) -> None:
    assert gateway.refusal(gateway.site.issue("machine", holder), Role.OPERATOR) == ("wrong_role", "machine")


def test_a_certificate_of_another_ca_is_refused(gateway: Gateway, tmp_path: Path) -> None:
    eve = Site(tmp_path / "other").issue("ann", Holder.SERVICE)
    assert gateway.refusal(eve)[0] == "wrong_certificate"


def test_an_expired_certificate_is_refused(gateway: Gateway) -> None:
    assert gateway.refusal(gateway.site.expired("ann", Holder.SERVICE))[0] == "wrong_certificate"


def test_a_revoked_certificate_is_refused_at_once(gateway: Gateway) -> None:
    ann = gateway.site.issue("ann", Holder.SERVICE)
    gateway.ask(ann)
    gateway.site.folder.revoke("ann", utc_now())
    assert gateway.refusal(ann) == ("revoked_certificate", "ann")


def test_without_the_revocation_list_nobody_is_let_in(gateway: Gateway) -> None:
    ann = gateway.site.issue("ann", Holder.SERVICE)
    (gateway.site.folder.path / "revoked.pem").write_bytes(b"damaged")
    assert gateway.refusal(ann) == ("revocation_unknown", "ann")


def test_an_altered_request_is_refused(gateway: Gateway) -> None:
    ann = gateway.site.issue("ann", Holder.SERVICE)
    assert gateway.refusal(ann, payload=PAYLOAD + b" ") == ("wrong_signature", "ann")


def test_the_certificate_of_one_with_the_key_of_another_is_refused(gateway: Gateway) -> None:
    ann, bob = (gateway.site.issue(name, Holder.SERVICE) for name in ("ann", "bob"))
    (bob / "certificate.pem").write_bytes((ann / "certificate.pem").read_bytes())
    assert gateway.refusal(bob) == ("wrong_signature", "ann")


def test_a_token_is_no_credential_where_certificates_are_required(gateway: Gateway) -> None:
    challenge = gateway.authoriser.challenge(NOW_NS)
    attachment = prove_by_token(bytes(32), KEY, PAYLOAD, challenge).model_dump_json().encode()
    with pytest.raises(NotAuthorised, match="accepts certificates of its"):
        gateway.authoriser.admit(SignedRequest(KEY, PAYLOAD, attachment), Role.SERVICE, NOW_NS)


@pytest.mark.parametrize("wall", [datetime(1970, 1, 1, tzinfo=UTC), utc_now() + timedelta(days=DAYS + 1)])
def test_outside_its_validity_by_the_wall_clock_a_certificate_is_refused(gateway: Gateway, wall: datetime) -> None:
    ann = gateway.site.issue("ann", Holder.SERVICE)
    gateway.wall = lambda: wall
    assert gateway.refusal(ann)[0] == "wrong_certificate"


def test_a_damaged_certificate_is_refused(gateway: Gateway) -> None:
    ann = gateway.site.issue("ann", Holder.SERVICE)
    pem = (ann / "certificate.pem").read_text()
    for damaged in ("", pem[:200], pem.replace("A", "B", 5), "-----BEGIN CERTIFICATE-----\n" + "A" * 3000):
        (ann / "certificate.pem").write_text(damaged)
        assert gateway.refusal(ann)[0] == "wrong_certificate"
    with pytest.raises(CertificateError):
        parse_authorities(b"")


CRANE_1 = "plumbline/v1/yard/crane-1/hook-1"
CRANE_2 = "plumbline/v1/yard/crane-2/hook-1"
SIGNING_KEY, OTHER_SIGNING_KEY = (SigningKey(Ed25519PrivateKey.generate()).public_hex for _ in range(2))


def vouch(folder: Path, gateway: str = CRANE_1, public_key: str = SIGNING_KEY) -> dict[str, Any]:
    return make(folder, gateway, public_key).model_dump()


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "keys")


@pytest.fixture
def authority(site: Site) -> SiteAuthority:
    return SiteAuthority(site.folder.path / "ca.pem", site.folder.path / "revoked.pem")


@pytest.mark.parametrize("name", ["crane-1", "crane-1.hook-1"])
def test_the_certificate_of_a_crane_or_of_one_sensor_of_it_vouches(
    site: Site, authority: SiteAuthority, name: str
) -> None:
    assert authority.refuse(CRANE_1, SIGNING_KEY, vouch(site.issue(name, Holder.GATEWAY))) is None


def test_a_renewed_certificate_vouches_too(site: Site, authority: SiteAuthority) -> None:
    site.issue("crane-1", Holder.GATEWAY, now=utc_now() - timedelta(days=1))
    renewed = site.folder.renew("crane-1", DAYS, utc_now())
    site.folder.revoke("crane-1", utc_now(), keep_newest=True)
    assert authority.refuse(CRANE_1, SIGNING_KEY, vouch(renewed)) is None


def test_planted_forgeries_are_refused_with_what_is_wrong(site: Site, authority: SiteAuthority, tmp_path: Path) -> None:
    own = site.issue("crane-1", Holder.GATEWAY)
    other_ca = Site(tmp_path / "other").issue("crane-1", Holder.GATEWAY)
    second = site.issue("crane-2", Holder.GATEWAY)
    right = vouch(own)
    forged: dict[str, object] = {
        "was not issued by this site's CA": vouch(other_ca),
        "is that of crane-2, not of crane-1 or crane-1.hook-1": vouch(second),
        "only": vouch(site.expired("old.hook-1", Holder.GATEWAY)),
        "is not that of a gateway, but that of router crane-1.x": vouch(site.issue("crane-1.x", Holder.ROUTER)),
        "but that of service ann": vouch(site.issue("ann", Holder.SERVICE)),
        "does not vouch for this key": vouch(own, public_key=OTHER_SIGNING_KEY),
        "does not vouch for this key of this gateway": vouch(own, gateway=CRANE_1.replace("yard", "quay")),
        "has a voucher that cannot be read": {**right, "signature": "zz"},
        "voucher that cannot be read": {**right, "more": 1},
    }
    for part, voucher in forged.items():
        assert part in str(authority.refuse(CRANE_1, SIGNING_KEY, voucher)), part
    for voucher in (None, [], "x", {**right, "certificate": "x" * 4097}):
        assert authority.refuse(CRANE_1, SIGNING_KEY, voucher) is not None
    stolen = {**right, "certificate": vouch(second)["certificate"]}
    assert authority.refuse(CRANE_2, SIGNING_KEY, stolen) is not None  # another's certificate, without its key
    assert authority.refuse(CRANE_1, SIGNING_KEY, right) is None


def test_an_expired_certificate_vouches_no_more(site: Site, authority: SiteAuthority) -> None:
    expired = site.expired("crane-1", Holder.GATEWAY)
    assert "valid from" in str(authority.refuse(CRANE_1, SIGNING_KEY, vouch(expired)))


def test_a_revoked_certificate_vouches_no_more_and_a_damaged_list_lets_none_vouch(
    site: Site, authority: SiteAuthority
) -> None:
    voucher = vouch(site.issue("crane-1", Holder.GATEWAY))
    assert authority.refuse(CRANE_1, SIGNING_KEY, voucher) is None
    site.folder.revoke("crane-1", utc_now())
    assert "was revoked" in str(authority.refuse(CRANE_1, SIGNING_KEY, voucher))
    (site.folder.path / "revoked.pem").write_text("damaged")
    assert "revocation list" in str(authority.refuse(CRANE_1, SIGNING_KEY, voucher))
    (site.folder.path / "ca.pem").unlink()
    assert "cannot be read" in str(authority.refuse(CRANE_1, SIGNING_KEY, voucher))
