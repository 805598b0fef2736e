"""The checks of `plumbline doctor --security`: what is open, to whom, and what has expired."""

import stat
from collections.abc import Iterator
from pathlib import Path

from gateway.authorization.credential import TOKEN_NAME
from gateway.bus.credentials import VARIABLE
from gateway.configuration.bus_section import EXPIRES_SOON_DAYS, BusSection, find_problems, is_encrypted, is_loopback
from gateway.configuration.model import Configuration
from gateway.configuration.remote_change import describe_changes
from gateway.daemon.commands.security import read_certificates
from gateway.daemon.doctor import CheckResult
from gateway.pki.signing_key import KEY_NAME

OTHERS, GROUP_OR_OTHERS = 0o007, 0o077


def examine_security(configuration: Configuration) -> Iterator[CheckResult]:
    """State what a gateway with this configuration leaves open; yields each result at once."""
    yield from _listeners(configuration.bus)
    yield from _reading(configuration.bus)
    yield from _commands(configuration)
    yield from _certificates(configuration.bus, configuration.gateway.key)
    yield from _files(configuration)
    yield from _page(configuration)
    for line in describe_changes(configuration.gateway.data_dir, configuration.alerts):
        yield CheckResult("note", "limits", line)


def _listeners(bus: BusSection) -> Iterator[CheckResult]:
    for endpoint in bus.active_listeners:
        if is_loopback(endpoint):
            yield CheckResult("good", "listener", f"{endpoint}: this machine alone")
        elif is_encrypted(endpoint):
            yield CheckResult("good", "listener", f"{endpoint}: the network, by mutual TLS")
        else:
            text = (
                f"{endpoint}: everyone on the network may read, unencrypted (bus.allow_unencrypted); listen on tls/..."
            )
            yield CheckResult("bad", "listener", text)
    for endpoint in bus.connect:
        open_link = not (is_encrypted(endpoint) or is_loopback(endpoint))
        text = f"{endpoint}: " + (
            "unencrypted over the network; connect to tls/..." if open_link else "a protected link"
        )
        yield CheckResult("bad" if open_link else "good", "link", text)


def _reading(bus: BusSection) -> Iterator[CheckResult]:
    access = bus.access
    names = [*access.operators, *access.services]
    if bus.exposed_listeners:
        yield CheckResult("bad", "reading", "everyone on the network, through the unencrypted listener")
    elif not bus.tls.enabled:
        yield CheckResult("note", "reading", "every user of this machine")
    elif names:
        yield CheckResult("good", "reading", f"by certificate: {', '.join(names)}")
    else:
        yield CheckResult("good", "reading", "every certificate of the site's CA (bus.access restricts it to names)")
    if bus.tls.enabled and not access.load_signals:
        text = "every certificate of the site may send it; name that of the load cell in bus.access.load_signals"
        yield CheckResult("note", "load signal", text)


def _commands(configuration: Configuration) -> Iterator[CheckResult]:
    if configuration.bus.tls.enabled:
        yield CheckResult("good", "commands", "signed with a certificate whose role is operator or service")
        if configuration.bus.tls.revoked is None:
            yield CheckResult(
                "note", "commands", "bus.tls.revoked is not set: a lost certificate commands until it expires"
            )
        return
    yield CheckResult("good", "commands", f"by the token of this machine ({TOKEN_NAME})")
    if configuration.bus.exposed_listeners:
        yield CheckResult(
            "bad", "commands", f"{VARIABLE} on other machines means that the token is copied; use certificates"
        )


def _certificates(bus: BusSection, key: str) -> Iterator[CheckResult]:
    problems = list(find_problems(bus.tls.files))
    for problem in problems:
        yield CheckResult("bad", "certificates", problem)
    certificates = None if problems else read_certificates(bus.tls)
    days_left = None if certificates is None else certificates.days_left()
    if days_left is not None:
        soon = days_left < EXPIRES_SOON_DAYS
        text = f"{bus.tls.certificate}: {days_left} days left" + (
            "; plumbline keys renew makes a new one" if soon else ""
        )
        yield CheckResult("bad" if soon else "good", "certificates", text)
    other_name = None if certificates is None else certificates.other_name(key)
    if other_name is not None:
        text = (
            f"{other_name}: it does not vouch for the signing key of {key}, which others then meet as NOT AUTHENTICATED"
        )
        yield CheckResult("note", "certificates", text)


def _files(configuration: Configuration) -> Iterator[CheckResult]:
    data_dir, tls = configuration.gateway.data_dir, configuration.bus.tls
    places: tuple[tuple[Path | None, int, str], ...] = (
        (data_dir / TOKEN_NAME, OTHERS, "0640"),
        (configuration.recorder.key or data_dir / KEY_NAME, GROUP_OR_OTHERS, "0600"),
        (tls.key, GROUP_OR_OTHERS, "0600"),
    )
    for path, forbidden, wanted in places:
        if path is None or not path.exists():
            continue
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & forbidden:
            yield CheckResult("bad", "files", f"{path}: mode {mode:04o}; correct: chmod {wanted} {path}")
        else:
            yield CheckResult("good", "files", f"{path}: mode {mode:04o}")


def _page(configuration: Configuration) -> Iterator[CheckResult]:
    page = configuration.page
    if not page.enabled:
        yield CheckResult("good", "page", "off")
    elif is_loopback(f"tcp/{page.listen}"):
        yield CheckResult("good", "page", f"http://{page.listen}/: this machine alone")
    else:
        text = f"http://{page.listen}/: everyone on the network may read it, unencrypted; use ssh -L, or a TLS proxy before it"
        yield CheckResult("bad", "page", text)
