"""Whether what comes under the name of a gateway is signed with its key, and fresh: the one place where that is judged.

A key is trusted that a person has put into a folder of credentials, or that was pinned at the first contact; where a CA is known,
that is one for which it vouches. Freshness needs no
clock: the gateway signs its answer to a random question, which tells the present boot and its time; by that no message may be
older than `MAX_AGE_S`, nor than the one before it. All methods may be called by any thread.
"""

import os
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import zenoh

from gateway.authorization.message_signature import (
    MessageSignature,
    Question,
    parse_signature,
    split_signature,
)
from gateway.bus.known_gateways import NO_SIGNERS, Signers, can_pin, known_statement, pin_key
from gateway.bus.untrusted import MOST_GATEWAYS, is_gateway_key, make_question, read_attachment, send_question
from gateway.pki.signing_key import KEY_NAME, PUBLIC_SUFFIX, KeyFileError, fingerprint

MAX_AGE_S = 5.0
"""A message that was signed longer ago proves nothing of the present. Basis: a choice; several heartbeats, and more than a busy
receiver is late."""
LONGEST_ANSWER_S = 2.0
"""An answer that took longer tells the gateway's time too badly. Basis: a choice; a link across a site needs a fraction of it."""
DOUBT_S = 10.0
"""What comes under a gateway's name and is not its own is a finding for this time. Basis: a choice; long enough to be read."""
ASK_PAUSE_S = 1.0
"""Pause between two questions to a gateway. Basis: a choice; it answers within milliseconds."""
RENEWAL_S = 600.0
"""The gateway's time is asked for again after this time. Basis: two clocks that differ by 100 ppm part by 0.06 s in it."""
MOST_QUESTIONS = 50
"""Questions that are sent at once. Basis: a choice; invented names cost little, and a fleet is asked within seconds."""
MOST_BOOTS = 4
"""Boots of a gateway that are remembered. Basis: a choice; two gateways of one name, and a restart of each."""
CHALLENGE = "rpc/challenge"
DoubtKind = Literal["unsigned", "unknown", "wrong", "unproved"]
"""Not signed; signed with a key that nobody here knows; not signed with the key that is known, or not so; signed right, and old,
repeated, or before the gateway has answered."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """Why a message or an answer is not authenticated."""

    kind: DoubtKind
    text: str

    def __str__(self) -> str:
        """Return the mark with the reason."""
        return f"NOT AUTHENTICATED: {self.text}"


def newer_doubt(before: tuple[Doubt, float] | None, doubt: Doubt, at_s: float) -> tuple[Doubt, float]:
    """Return the doubt that tells more, and when it came: a late message does not hide a forged one."""
    if before is None or doubt.kind != "unproved":
        return doubt, at_s
    is_hidden = before[0].kind != "unproved" and at_s - before[1] <= DOUBT_S
    return before if is_hidden else (doubt, at_s)


UNSIGNED = Doubt("unsigned", "it is not signed")
ALTERED = Doubt("wrong", "its signature is wrong")
UNANSWERED = Doubt("unproved", "the gateway has not answered since its start")
OLD = Doubt("unproved", "an earlier message came again, or late")
TOO_MANY = Doubt("unknown", "too many names of gateways, or one that no configuration allows")


@dataclass(slots=True)
class _Gateway:
    """What is known of a gateway; times by its own clock minus this machine's monotonic one, ns."""

    boots: dict[str, int] = field(default_factory=dict)
    """How far its time is ahead of ours at least, by boot."""
    newest_ns: dict[tuple[str, str], int] = field(default_factory=dict)
    """When the newest message was signed, by boot and topic."""
    key: str | None = None
    """The key that is pinned, as it was last read."""
    refused: tuple[str, str, Doubt] | None = None
    """Key and boot for which the site's CA does not vouch, and why; None: it was not asked."""
    is_to_be_asked: bool = False
    asked_s: float = float("-inf")


class Authenticity:
    """Judges messages and answers of gateways."""

    def __init__(
        self,
        signers: Signers = NO_SIGNERS,
        accepted: str | None = None,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """`signers` are the keys in folders of credentials; `accepted` is the fingerprint of a key that replaces a pinned one."""
        self._signers = signers
        self._present_signers = signers.read()
        self._read_at_s = time.monotonic()
        self._accepted = accepted
        self._environment = environment
        self._lock = threading.Lock()
        self._gateways: dict[str, _Gateway] = {}

    def judge_message(
        self, name: str, topic: str, payload: bytes, attachment: bytes | None, at_s: float, *, live: bool = True
    ) -> Doubt | None:
        """Return what is doubtful about a message that came at a monotonic time; None: nothing. Not `live`: kept by others."""
        signature = parse_signature(attachment)
        with self._lock:
            gateway = self._find(name)
            if gateway is None:
                return TOO_MANY
            if signature is None:
                return self._judge_unsigned(name, gateway)
            key = self._judge_key(name, gateway, signature.public_key)
            if key is not None and key.kind != "unproved":
                return key
            if (content := _judge_content(partial(signature.is_of_message, f"{name}/{topic}", payload))) is not None:
                return content
            if key is not None:
                refused = _find_refusal(gateway, signature)
                gateway.is_to_be_asked = refused is None
                return refused or key
            gateway.key = signature.public_key
            return _judge_freshness(gateway, topic, signature, round(at_s * 1e9), live=live)

    def judge_answer(
        self,
        key_expr: str,
        question: Question,
        payload: bytes,
        attachment: bytes | None,
        sent_s: float,
        *,
        accepted: bool = True,
    ) -> Doubt | None:
        """Return what is doubtful about an answer that has just come; None: nothing. It pins the key at the first contact.

        Where a CA is known, only the answer to a challenge does: it has the voucher.
        """
        name, at_s = key_expr.partition("/rpc/")[0], time.monotonic()
        signature = parse_signature(attachment)
        with self._lock:
            gateway = self._find(name)
            if gateway is None:
                return TOO_MANY
            if signature is None:
                return self._judge_unsigned(name, gateway)
            doubt = self._judge_key(name, gateway, signature.public_key)
            is_replaced = doubt is not None and fingerprint(signature.public_key) == self._accepted
            if doubt is not None and doubt.kind != "unproved" and not is_replaced:
                return doubt
            check = partial(signature.is_of_answer, key_expr, payload, question, accepted=accepted)
            if (content := _judge_content(check)) is not None:
                return content
            if doubt is not None:
                refused = self._admit_key(gateway, key_expr, payload, signature, is_accepted=is_replaced)
                if refused is not None:
                    return refused
            gateway.key = signature.public_key
            if at_s - sent_s <= LONGEST_ANSWER_S:
                gateway.boots.pop(signature.boot_id, None)
                gateway.boots[signature.boot_id] = signature.time_ns - round(at_s * 1e9)
                while len(gateway.boots) > MOST_BOOTS:
                    gateway.boots.pop(next(iter(gateway.boots)))
                gateway.newest_ns = {each: at for each, at in gateway.newest_ns.items() if each[0] in gateway.boots}
            return None

    def judge_reply(self, key_expr: str, question: Question, reply: zenoh.Reply, sent_s: float) -> Doubt | None:
        """Return what is doubtful about a reply to a question to one gateway, also about a refusal."""
        if reply.ok is not None:
            signed, attachment = reply.ok.payload.to_bytes(), read_attachment(reply.ok)
        else:
            signed, attachment = split_signature(b"" if reply.err is None else reply.err.payload.to_bytes())
        return self.judge_answer(key_expr, question, signed, attachment, sent_s, accepted=reply.ok is not None)

    def meet(self, session: zenoh.Session, pattern: str) -> None:
        """Ask the gateways that match a pattern for their vouchers and wait, where a CA decides at the first contact."""
        if self._signers.refuse is None:
            return
        question, sent_s = make_question(), time.monotonic()
        for reply in send_question(session, f"{pattern}/{CHALLENGE}", question, LONGEST_ANSWER_S):
            if reply.ok is not None:
                self.judge_reply(str(reply.ok.key_expr), question, reply, sent_s)

    def expect(self, name: str) -> None:
        """Note that a gateway is there, to be asked before its first message is judged."""
        with self._lock:
            if (gateway := self._find(name)) is not None and not gateway.boots:
                gateway.is_to_be_asked = True

    def ask(self, session: zenoh.Session) -> None:
        """Ask the gateways whose messages cannot be judged yet, without waiting for the answers."""
        now_s = time.monotonic()
        with self._lock:
            due = [name for name, gateway in self._gateways.items() if _is_due(gateway, now_s)][:MOST_QUESTIONS]
            for name in due:
                self._gateways[name].asked_s = now_s
                self._gateways[name].is_to_be_asked = False
        for name in due:
            question, key_expr = make_question(), f"{name}/{CHALLENGE}"
            take = partial(self._take, key_expr, question, now_s)
            with suppress(zenoh.ZError):  # the link is down
                send_question(session, key_expr, question, LONGEST_ANSWER_S, take)

    def _take(self, key_expr: str, question: Question, sent_s: float, reply: zenoh.Reply) -> None:
        self.judge_reply(key_expr, question, reply, sent_s)

    def _find(self, name: str) -> _Gateway | None:
        if name not in self._gateways:
            if len(self._gateways) >= MOST_GATEWAYS or not is_gateway_key(name):
                return None
            self._gateways[name] = _Gateway()
        return self._gateways[name]

    def _is_signer(self, public_key: str) -> bool:
        """Return whether a key is in a folder of credentials, where a gateway may just have put it."""
        if public_key not in self._present_signers and time.monotonic() - self._read_at_s >= ASK_PAUSE_S:
            self._present_signers, self._read_at_s = self._signers.read(), time.monotonic()
        return public_key in self._present_signers

    def _judge_unsigned(self, name: str, gateway: _Gateway) -> Doubt:
        """Return the doubt about what is not signed: where a key is known, it is not the gateway's."""
        known = known_statement(name, self._environment) if gateway.key is None else None
        key = gateway.key if known is None else known.public_key
        if key is None:
            return Doubt("wrong", UNSIGNED.text) if self._signers.are_all else UNSIGNED
        return Doubt("wrong", f"it is not signed, and the key {fingerprint(key)} is known")

    def _judge_key(self, name: str, gateway: _Gateway, public_key: str) -> Doubt | None:
        """Return what is doubtful about a key; `unproved` where it may be pinned with the first answer."""
        if public_key == gateway.key:
            return None
        known = known_statement(name, self._environment)
        if known is None:
            if self._is_signer(public_key):
                return None
            if self._signers.are_all or gateway.key is not None:
                return _unknown(public_key, "wrong")
            is_decided_later = self._signers.refuse is not None or can_pin(name, self._environment)
            return UNANSWERED if is_decided_later else _unknown(public_key)
        if known.public_key == public_key:
            gateway.key = public_key
            return None
        found, before = fingerprint(public_key), fingerprint(known.public_key)
        return Doubt(
            "wrong",
            f"it is signed with the key {found}, and {before} is pinned; where that is right: "
            f"plumbline remote status --gateway {name} --accept-key {found}",
        )

    def _admit_key(
        self, gateway: _Gateway, key_expr: str, payload: bytes, signature: MessageSignature, *, is_accepted: bool
    ) -> Doubt | None:
        """Pin a key that nobody here knows, unless the site's CA is known and does not vouch for it; return why not."""
        name, _, verb = key_expr.partition("/rpc/")
        asks_authority = self._signers.refuse is not None and not is_accepted
        if asks_authority:
            if f"rpc/{verb}" != CHALLENGE:
                gateway.is_to_be_asked = True
                return _find_refusal(gateway, signature) or UNANSWERED
            reason = self._signers.judge_challenge(name, signature.public_key, payload)
            if reason is not None:
                doubt = _not_vouched_for(name, signature.public_key, reason)
                gateway.refused = signature.public_key, signature.boot_id, doubt
                return doubt
        is_pinned = pin_key(name, signature.public_key, self._environment)
        return None if is_pinned or asks_authority else _unknown(signature.public_key)


def _find_refusal(gateway: _Gateway, signature: MessageSignature) -> Doubt | None:
    refused = gateway.refused
    return refused[2] if refused is not None and refused[:2] == (signature.public_key, signature.boot_id) else None


def _judge_content(is_signed: "partial[bool]") -> Doubt | None:
    try:
        return None if is_signed() else ALTERED
    except KeyFileError as error:
        return Doubt("unknown", str(error))


def _judge_freshness(
    gateway: _Gateway, topic: str, signature: MessageSignature, at_ns: int, *, live: bool
) -> Doubt | None:
    place = signature.boot_id, topic
    ahead_ns = gateway.boots.get(signature.boot_id)
    if ahead_ns is None:
        gateway.is_to_be_asked = True
        return UNANSWERED
    if not live:
        return None
    age_ns = at_ns + ahead_ns - signature.time_ns
    if age_ns > MAX_AGE_S * 1e9:
        gateway.is_to_be_asked = True
        return OLD
    if signature.time_ns <= gateway.newest_ns.get(place, -1):
        return OLD
    gateway.newest_ns[place] = signature.time_ns
    gateway.boots[signature.boot_id] = max(ahead_ns, signature.time_ns - at_ns)  # it has come: so late it is there
    return None


def _is_due(gateway: _Gateway, now_s: float) -> bool:
    is_met = bool(gateway.boots) or gateway.refused is not None
    pause_s = ASK_PAUSE_S if gateway.is_to_be_asked else RENEWAL_S if is_met else float("inf")
    return now_s - gateway.asked_s >= pause_s


def _unknown(public_key: str, kind: DoubtKind = "unknown") -> Doubt:
    return Doubt(
        kind,
        f"nobody here knows the key {fingerprint(public_key)}; name a folder with the gateway's {KEY_NAME}{PUBLIC_SUFFIX} by "
        "--credentials, or give the gateway a gateway.site of its own",
    )


def _not_vouched_for(name: str, public_key: str, reason: str) -> Doubt:
    found = fingerprint(public_key)
    return Doubt(
        "unknown",
        f"the site's CA does not vouch for the key {found}: {reason}; where it is right nevertheless: "
        f"plumbline remote status --gateway {name} --accept-key {found}",
    )
