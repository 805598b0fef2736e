"""Notices another gateway with the same key and the same signing key, such as one that runs from a copy of this one's disk.

A token of liveliness proves nothing: whoever may connect can declare one. Each gateway therefore declares to every other boot
that it hears of a second token, with its signature for these two boots. A boot that does not prove itself so is no fault: it is
counted as refused, and what it sends is not authentic to those who have heard this gateway.
"""

import json
import re
import threading
import time
from collections.abc import Callable

import zenoh

from gateway.daemon.runtime.worker import FaultRegister
from gateway.pki.signing_key import SigningKey, is_valid
from gateway.topics import ALIVE

PART = "identity"
UNPROVED = "unproved_presence"
BOOT_ID = re.compile(r"[0-9a-f]{12}")
SIGNATURE = re.compile(r"[0-9a-f]{128}")
MAX_BOOTS = 64
"""Boots that are remembered, and proofs that wait. Basis: a choice; two gateways need two, restarts some more, and the memory is
bounded."""
MOST_AT_ONCE = 16
"""Signatures that are made or checked at a time. Basis: 0.16 ms each, and an idle thread that looks once a second."""
MIN_DUPLICATE_S = 5.0
"""Time for which two boots may be alive. Basis: a gateway that was killed and started again is alive twice until the lease of its
former link (1.5 s) has ended."""


class DuplicateWatch:
    """Declares the boot id of this gateway as a liveliness token, and watches those of others."""

    def __init__(
        self,
        key: str,
        boot_id: str,
        faults: FaultRegister,
        signing_key: Callable[[], SigningKey | None],
        refuse: Callable[[str, str, str], object],
    ) -> None:
        """`signing_key` returns this gateway's; None: nobody can be noticed. `refuse` takes key, kind and reason."""
        self._prefix = f"{key}/{ALIVE}/"
        self._key = key
        self._boot_id = boot_id
        self._faults = faults
        self._signing_key = signing_key
        self._refuse = refuse
        self._lock = threading.Lock()
        self._seen_s: dict[str, float] = {}
        """Boot ids of others that are alive, with the time since when."""
        self._arrived: set[tuple[str, str]] = set()
        """Boot ids with signatures that are not checked yet."""
        self._proved: dict[str, tuple[str, float]] = {}
        """Boot ids of others that have this gateway's signing key, with their signature and the time since when it is known."""
        self._session: zenoh.Session | None = None
        self._declared: tuple[zenoh.LivelinessToken, zenoh.Subscriber[None]] | None = None
        self._shown: dict[str, zenoh.LivelinessToken] = {}
        """The proofs of this gateway, by the boot for which each is made."""

    def attach(self, session: zenoh.Session) -> None:
        """Watch on a session from now on. Raises `zenoh.ZError`."""
        token = session.liveliness().declare_token(f"{self._prefix}{self._boot_id}")
        watch = session.liveliness().declare_subscriber(f"{self._prefix}**", self._note, history=True)
        self._session, self._declared = session, (token, watch)

    def poll(self) -> None:
        """Exchange proofs, and set or clear the fault; call about once a second. Raises `zenoh.ZError`."""
        own, now_s = self._signing_key(), time.monotonic()
        if own is not None:
            self._show_proofs(own)
            self._check_proofs(own, now_s)
        with self._lock:
            others = sorted(boot for boot, (_, since_s) in self._proved.items() if now_s - since_s > MIN_DUPLICATE_S)
            unproved = sorted(
                boot
                for boot, since_s in self._seen_s.items()
                if now_s - since_s > 2 * MIN_DUPLICATE_S and boot not in self._proved
            )
            for boot in unproved:
                self._seen_s[boot] = float("inf")  # it is refused once
        if unproved:
            why = (
                f"boot {', '.join(unproved[:4])} has this gateway's name and not its signing key: another gateway with the same "
                "gateway.site, crane and sensor, or somebody who pretends to be one"
            )
            self._refuse(ALIVE, UNPROVED, why)
        if others:
            self._faults.set(
                PART,
                f"another gateway has the same key {self._key} (boot {', '.join(others)}): their messages mix, and a command may "
                "reach either; give one of them another gateway.site, crane or sensor",
            )
        else:
            self._faults.clear(PART)

    def _show_proofs(self, own: SigningKey) -> None:
        """Prove this gateway to the boots that have come, and forget those that have gone."""
        with self._lock:
            seen = set(self._seen_s)
        for boot in self._shown.keys() - seen:
            self._shown.pop(boot).undeclare()
        for boot in sorted(seen - self._shown.keys())[:MOST_AT_ONCE]:
            signature = own.sign(_statement(self._key, self._boot_id, boot))
            token = f"{self._prefix}{self._boot_id}/{boot}/{signature}"
            if self._session is not None:
                self._shown[boot] = self._session.liveliness().declare_token(token)

    def _check_proofs(self, own: SigningKey, now_s: float) -> None:
        with self._lock:
            arrived = sorted(self._arrived)[:MOST_AT_ONCE]
            self._arrived.difference_update(arrived)
        for boot, signature in arrived:
            if is_valid(own.public_hex, _statement(self._key, boot, self._boot_id), signature):
                with self._lock:
                    self._proved.setdefault(boot, (signature, now_s))

    def _note(self, sample: zenoh.Sample) -> None:
        """Take a token. Called by the bus."""
        boot, *rest = str(sample.key_expr).removeprefix(self._prefix).split("/")
        if boot == self._boot_id or BOOT_ID.fullmatch(boot) is None:
            return
        is_gone = sample.kind == zenoh.SampleKind.DELETE
        with self._lock:
            if not rest:
                self._note_boot(boot, is_gone=is_gone)
            elif len(rest) == 2 and rest[0] == self._boot_id and SIGNATURE.fullmatch(rest[1]):
                self._note_proof(boot, rest[1], is_gone=is_gone)

    def _note_boot(self, boot: str, *, is_gone: bool) -> None:
        if is_gone:
            self._seen_s.pop(boot, None)
        elif len(self._seen_s) < MAX_BOOTS:
            self._seen_s.setdefault(boot, time.monotonic())

    def _note_proof(self, boot: str, signature: str, *, is_gone: bool) -> None:
        if is_gone:
            self._arrived.discard((boot, signature))
            if self._proved.get(boot, ("",))[0] == signature:
                del self._proved[boot]
        elif len(self._arrived) < MAX_BOOTS:
            self._arrived.add((boot, signature))


def _statement(key: str, boot_id: str, to_boot_id: str) -> str:
    """Return the text by which a boot proves itself to another one; it is worth nothing to a third."""
    return json.dumps(["plumbline-presence-1", key, boot_id, to_boot_id])
