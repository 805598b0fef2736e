"""Notices another gateway with the same key: its messages would mix with ours, and a command might reach the wrong crane."""

import re
import threading
import time

import zenoh

from gateway.daemon.runtime.faults import FaultRegister

PART = "identity"
ALIVE = "alive"
BOOT_ID = re.compile(r"[0-9a-f]{12}")
MAX_BOOTS = 8
"""Boots that are remembered. Basis: a choice; two gateways need two, restarts some more, and the memory is bounded."""
MIN_DUPLICATE_S = 5.0
"""Time for which two boots may be alive. Basis: a gateway that was killed and started again is alive twice until the lease of its
former link (1.5 s) has ended."""


class DuplicateWatch:
    """Declares the boot id of this gateway as a liveliness token, and watches those of others."""

    def __init__(self, key: str, boot_id: str, faults: FaultRegister) -> None:
        self._key = key
        self._boot_id = boot_id
        self._faults = faults
        self._lock = threading.Lock()
        self._seen_s: dict[str, float] = {}
        """Boot ids of others that are alive, with the time since when."""
        self._declared: tuple[zenoh.LivelinessToken, zenoh.Subscriber[None]] | None = None

    def attach(self, session: zenoh.Session) -> None:
        """Watch on a session from now on. Raises `zenoh.ZError`."""
        token = session.liveliness().declare_token(f"{self._key}/{ALIVE}/{self._boot_id}")
        watch = session.liveliness().declare_subscriber(f"{self._key}/{ALIVE}/*", self._note, history=True)
        self._declared = token, watch

    def poll(self) -> None:
        """Set or clear the fault; call about once a second."""
        now_s = time.monotonic()
        with self._lock:
            others = sorted(boot_id for boot_id, since_s in self._seen_s.items() if now_s - since_s > MIN_DUPLICATE_S)
        if others:
            self._faults.set(
                PART,
                f"another gateway has the same key {self._key} (boot {', '.join(others)}): their messages mix, and a command may "
                "reach either; give one of them another gateway.site, crane or sensor",
            )
        else:
            self._faults.clear(PART)

    def _note(self, sample: zenoh.Sample) -> None:
        boot_id = str(sample.key_expr).rpartition("/")[2]
        if boot_id == self._boot_id or BOOT_ID.fullmatch(boot_id) is None:
            return
        with self._lock:
            if sample.kind == zenoh.SampleKind.DELETE:
                self._seen_s.pop(boot_id, None)
            elif len(self._seen_s) < MAX_BOOTS:
                self._seen_s.setdefault(boot_id, time.monotonic())
