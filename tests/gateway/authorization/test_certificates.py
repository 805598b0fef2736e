"""The certificate scheme: whose signature is accepted, and for what."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from gateway.authorization.caller import Caller, NotAuthorised, Role
from gateway.authorization.certificates import CertificateVerifier
from gateway.authorization.credential import Authoriser, SignedRequest, prove_by_token
from gateway.bus.credentials import load_credentials
from gateway.pki.inspect import CertificateError, parse_authorities, revoked_serials
from gateway.pki.site_folder import Holder, utc_now
from tests.gateway.pki.site import DAYS, Site

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
