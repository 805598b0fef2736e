"""What commands are authorised by, and the security log: every refusal is counted, and written with who.

Certificates authorise where the site has a CA, else the token of the service's group. A flood of refusals fills neither the file
nor the log: those of one key, kind and name are merged: the first is written at once, then the number of further ones after a
minute, two, four, up to an hour. All together write at most one line in ten seconds after a first few.
"""

import json
import logging
import secrets
from collections import Counter, OrderedDict
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.atomic_io import append_line, write_private
from gateway.authorization.authoriser import Authoriser
from gateway.authorization.caller import RateLimit, TokenBucket
from gateway.authorization.credential import TOKEN_BYTES, TOKEN_NAME, parse_token
from gateway.configuration.bus_section import TlsSection
from gateway.errors import PlumblineError
from gateway.extras import what_is_missing
from gateway.file_input import read_bounded
from gateway.pki.signing_key import SigningKey

if TYPE_CHECKING:
    from gateway.daemon.commands.site_certificates import SiteCertificates  # its library is an extra

log = logging.getLogger("plumbline.security")
SECURITY_LOG_NAME = "security.jsonl"
MAX_FILE_BYTES = 4_000_000
"""Size at which the file becomes the previous file; there is one previous file. Basis: a choice; some ten thousands of lines, and
two files are nothing to a card."""
MAX_SOURCES = 64
"""Sources with a pause of their own. Basis: a choice; more than a site has callers, and a bound of the memory."""
FIRST_PAUSE_S, LONGEST_PAUSE_S = 60.0, 3600.0
"""Pauses between two lines about one source, the first and the longest. Basis: a choice; a minute tells of a beginning, an hour
of what goes on."""
LINES = RateLimit(burst=30, per_s=0.1)
"""For all sources together. Basis: a choice; a burst tells of many sources, then six lines a minute do not fill the disk."""
TOKEN_MODE = 0o640
OTHERS = 0o007


@dataclass(frozen=True, slots=True)
class Refusal:
    """One refused request or message."""

    key: str
    """The key below that of the gateway: rpc/zero, load; or page/sign-in."""
    kind: str
    name: str | None
    """Authenticated name, where there is one."""
    reason: str


@dataclass(slots=True)
class _Source:
    """The refusals of one key, kind and name."""

    next_ns: int
    pause_s: float = FIRST_PAUSE_S
    unwritten: int = 0


class SecurityLog:
    """`<data_dir>/security.jsonl`, apart from the audit of what was done."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._sources: OrderedDict[tuple[str, str, str | None], _Source] = OrderedDict()
        self._lines = TokenBucket(LINES)
        self.counts: Counter[str] = Counter()
        """Refusals since start, by kind."""
        self.write_failures = 0

    def add(self, refusal: Refusal, origin: Callable[[], str], now_ns: int, number: int = 1) -> None:
        """Count refusals, and write them where that is due; `origin` is asked for what is written alone."""
        self.counts[refusal.kind] += number
        key = (refusal.key, refusal.kind, refusal.name)
        source = self._sources.setdefault(key, _Source(next_ns=now_ns))
        self._sources.move_to_end(key)
        while len(self._sources) > MAX_SOURCES:
            self._sources.popitem(last=False)
        source.unwritten += number
        if now_ns < source.next_ns or not self._lines.take(now_ns):
            return
        self._write(refusal, origin(), source.unwritten)
        source.unwritten = 0
        source.next_ns = now_ns + round(source.pause_s * 1e9)
        source.pause_s = min(2 * source.pause_s, LONGEST_PAUSE_S)

    def _write(self, refusal: Refusal, origin: str, count: int) -> None:
        who = origin if refusal.name is None else f"{refusal.name} at {origin}"
        log.warning("refused: %s by %s, %d times: %s", refusal.key, who, count, refusal.reason)
        at = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        content = {"key": refusal.key, "kind": refusal.kind, "name": refusal.name, "origin": origin, "count": count}
        line = json.dumps({"time_utc": at, "event": "refused", **content, "reason": refusal.reason})
        try:
            append_line(self._path, line.encode(), durable=False, max_bytes=MAX_FILE_BYTES)
        except OSError:
            self.write_failures += 1  # the line is in the log, and so in the recording


def read_certificates(tls: TlsSection) -> "SiteCertificates | None":
    """Return the certificates of a site; None without a CA, or without the library that reads them."""
    if not tls.enabled:
        return None
    if (missing := what_is_missing("security")) is not None:
        log.error("bus.tls: %s; commands are refused", missing)
        return None
    from gateway.daemon.commands.site_certificates import SiteCertificates  # noqa: PLC0415 (an extra)

    return SiteCertificates(tls)


def make_voucher_source(
    gateway: str, key: Callable[[], SigningKey | None], certificates: "SiteCertificates | None"
) -> Callable[[], str | None]:
    """Return a function that returns what vouches for the gateway's key in JSON; None while nothing does."""

    def voucher() -> str | None:
        if certificates is None or (present := key()) is None:
            return None
        made = certificates.voucher(gateway, present.public_hex)
        return None if made is None else made.model_dump_json()

    return voucher


def make_authoriser(
    boot_id: str, data_dir: Path, tls: TlsSection, certificates: "SiteCertificates | None"
) -> Authoriser:
    """Return the authoriser of a boot. Where the certificates cannot be used it refuses every command, and why is logged."""
    if not tls.enabled:
        return Authoriser(boot_id, load_or_create_token(data_dir))
    if certificates is not None:
        try:
            return Authoriser(boot_id, certificates.verifier())
        except PlumblineError as error:
            log.error("bus.tls.ca %s; commands are refused until the next start", error)
    return refuse_all(boot_id)


def refuse_all(boot_id: str) -> Authoriser:
    """Return an authoriser that refuses every command: its secret is one that nobody has."""
    return Authoriser(boot_id, secrets.token_bytes(TOKEN_BYTES))


def load_or_create_token(data_dir: Path) -> bytes:
    """Return the secret. If the file cannot be used it is a secret that nobody has: commands are refused, and why is logged."""
    path = data_dir / TOKEN_NAME
    try:
        with suppress(FileNotFoundError):
            secret = parse_token(read_bounded(path).decode("ascii"))
            if secret is None:
                log.error("%s: is damaged; move it away so that the next start makes one; commands are refused", path)
                return secrets.token_bytes(TOKEN_BYTES)
            if path.stat().st_mode & OTHERS:
                log.warning("%s: every user may read it; correct: chmod 0640 %s", path, path)
            return secret
        secret = secrets.token_bytes(TOKEN_BYTES)
        write_private(path, f"{secret.hex()}\n".encode(), TOKEN_MODE)
    except (OSError, UnicodeDecodeError) as error:
        log.error("%s: cannot be used (%s); commands are refused", path, getattr(error, "strerror", None) or error)
        return secrets.token_bytes(TOKEN_BYTES)
    return secret
