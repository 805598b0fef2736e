"""Where the site's CA is known, a key is taken at the first contact if it vouches for it, and a pin stands above it."""

import json
import time
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gateway.authorization.message_signature import MessageSigner, Question
from gateway.bus.authenticity import UNANSWERED, Authenticity, Doubt
from gateway.bus.credentials import load_credentials
from gateway.bus.known_gateways import Signers, known_statement
from gateway.pki.signing_key import SigningKey, fingerprint
from gateway.pki.site_folder import Holder
from tests.gateway.pki.site import Site, vouch
from tests.values import present

YARD = "plumbline/v1/yard/crane-1/hook-1"
UNNAMED = "plumbline/v1/demo-site/crane-1/hook-1"
ASKED = Question(b"", b"0123456789abcdef")


class Gateway:
    """A gateway with a certificate, or whoever says so."""

    def __init__(self, folder: Path | None, name: str = YARD) -> None:
        self.name, self.key = name, SigningKey(Ed25519PrivateKey.generate())
        self.signer = MessageSigner(lambda: self.key, "0123456789ab", time.monotonic_ns)
        content: dict[str, object] = {"boot_id": "0123456789ab"}
        if folder is not None:
            content["voucher"] = vouch(folder, name, self.key.public_hex).model_dump()
        self.challenge = json.dumps(content).encode()

    def answer(self, receiver: Authenticity, verb: str = "challenge", payload: bytes | None = None) -> Doubt | None:
        payload, key_expr = self.challenge if payload is None else payload, f"{self.name}/rpc/{verb}"
        attachment = self.signer.sign_answer(key_expr, payload, ASKED, accepted=True)
        return receiver.judge_answer(key_expr, ASKED, payload, attachment, time.monotonic())

    def send(self, receiver: Authenticity) -> Doubt | None:
        attachment = self.signer.sign_message(f"{self.name}/alert", b"{}")
        return receiver.judge_message(self.name, "alert", b"{}", attachment, time.monotonic())


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path / "keys")


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    return {"XDG_STATE_HOME": str(tmp_path / "state")}


@pytest.fixture
def ann(site: Site) -> Signers:
    return load_credentials(site.issue("ann", Holder.SERVICE)).signers


@pytest.fixture
def receiver(ann: Signers, environment: dict[str, str]) -> Authenticity:
    return Authenticity(ann, environment=environment)


def test_a_key_for_which_the_ca_vouches_is_pinned_with_the_first_challenge(
    site: Site, receiver: Authenticity, environment: dict[str, str]
) -> None:
    gateway = Gateway(site.issue("crane-1", Holder.GATEWAY))
    assert gateway.send(receiver) is UNANSWERED
    assert gateway.answer(receiver, "status", b"{}") is UNANSWERED  # it has no voucher
    assert known_statement(YARD, environment) is None
    assert gateway.answer(receiver) is None
    assert present(known_statement(YARD, environment)).public_key == gateway.key.public_hex
    assert gateway.send(receiver) is None
    assert gateway.answer(receiver, "status", b"{}") is None


def test_who_stands_between_at_the_first_contact_is_not_pinned(
    site: Site, receiver: Authenticity, environment: dict[str, str], tmp_path: Path
) -> None:
    others = (
        (None, "no voucher"),
        (site.issue("router-1", Holder.ROUTER), "not that of a gateway"),
        (site.issue("crane-2", Holder.GATEWAY), "is that of crane-2"),
        (Site(tmp_path / "other").issue("crane-1", Holder.GATEWAY), "not issued by this site's CA"),
    )
    for folder, part in others:
        between = Gateway(folder)
        for doubt in (between.answer(receiver), between.send(receiver), between.answer(receiver, "status", b"{}")):
            assert present(doubt).kind == "unknown"
            assert part in present(doubt).text
    assert known_statement(YARD, environment) is None
    true = Gateway(site.issue("crane-1", Holder.GATEWAY))
    assert true.answer(receiver) is None
    assert true.send(receiver) is None
    assert present(between.send(receiver)).kind == "wrong"


def test_a_voucher_for_another_key_is_worth_nothing(site: Site, receiver: Authenticity) -> None:
    true, between = Gateway(site.issue("crane-1", Holder.GATEWAY)), Gateway(None)
    doubt = between.answer(receiver, payload=true.challenge)
    assert "does not vouch for this key" in present(doubt).text


def test_a_challenge_of_any_form_is_refused_without_an_error(receiver: Authenticity) -> None:
    between = Gateway(None)
    for payload in (b"", b"[]", b"\xff", b'{"voucher":' + b"[" * 9000, b'{"voucher":"\\ud800"}', b"1" * 20_000):
        assert present(between.answer(receiver, payload=payload)).kind == "unknown"


def test_a_pin_stands_above_the_ca(site: Site, ann: Signers, environment: dict[str, str]) -> None:
    before, again = Gateway(None), Gateway(site.issue("crane-1", Holder.GATEWAY))
    assert before.answer(Authenticity(environment=environment)) is None
    receiver = Authenticity(ann, environment=environment)
    assert before.answer(receiver, "status", b"{}") is None
    assert present(again.answer(receiver)).kind == "wrong"


def test_a_person_may_accept_a_key_for_which_nobody_vouches(ann: Signers, environment: dict[str, str]) -> None:
    old = Gateway(None)
    refused = present(old.answer(Authenticity(ann, environment=environment)))
    assert f"--gateway {YARD} --accept-key {fingerprint(old.key.public_hex)}" in refused.text
    accepting = Authenticity(ann, fingerprint(old.key.public_hex), environment)
    assert old.answer(accepting, "status", b"{}") is None
    assert old.answer(Authenticity(ann, environment=environment)) is None


def test_a_name_that_many_gateways_have_is_authentic_by_its_voucher_and_not_pinned(
    site: Site, receiver: Authenticity, environment: dict[str, str]
) -> None:
    gateway = Gateway(site.issue("crane-1", Holder.GATEWAY), UNNAMED)
    assert gateway.answer(receiver) is None
    assert gateway.send(receiver) is None
    assert known_statement(UNNAMED, environment) is None
