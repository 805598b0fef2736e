"""The credentials of a client: its certificate, and the command tokens and public keys of gateways that this user may read."""

import os
from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path

from gateway.authorization.credential import TOKEN_NAME, Challenge, parse_token, prove_by_token, token_id
from gateway.bus.known_gateways import NO_SIGNERS, RefuseKey, Signers
from gateway.bus.session import TlsFiles
from gateway.configuration.bus_section import TlsSection
from gateway.configuration.loading import is_installed, load, load_installed
from gateway.configuration.user_state import known_data_folders
from gateway.errors import InputError, PlumblineError
from gateway.extras import require_extra, what_is_missing
from gateway.file_input import read_bounded
from gateway.pki.signing_key import KEY_NAME, PUBLIC_SUFFIX, KeyFileError, read_public_key

VARIABLE = "PLUMBLINE_CREDENTIALS"
CA_NAME, CERTIFICATE_NAME, REVOKED_NAME = "ca.pem", "certificate.pem", "revoked.pem"


class Credentials:
    """What a client can prove, and whom it knows."""

    def __init__(self, tokens: Iterable[bytes], tls: TlsFiles | None = None, signers: Signers = NO_SIGNERS) -> None:
        self._tokens = {token_id(secret): secret for secret in tokens}
        self.tls = tls
        """The certificate, for links with TLS and for signatures; None without one."""
        self.signers = signers
        """The public keys of gateways in the folders."""

    def prove(self, key_expr: str, payload: bytes, challenge: Challenge) -> bytes | None:
        """Return the attachment that proves a request, or None without the credential that the gateway asks for."""
        if challenge.scheme == "certificate":
            return None if self.tls is None else _sign(self.tls, key_expr, payload, challenge)
        secret = self._tokens.get(challenge.token_id or "")
        if secret is None:
            return None
        return prove_by_token(secret, key_expr, payload, challenge).model_dump_json().encode()


def load_credentials(folder: Path | None = None) -> Credentials:
    """Return the credentials of a folder, of `$PLUMBLINE_CREDENTIALS`, or of the gateways of this machine.

    Raises `InputError` for a named folder without credentials.
    """
    named = folder or (Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None)
    if named is None:
        tokens = [secret for place in _usual_folders() if (secret := _read_token(place)) is not None]
        return Credentials(tokens, _installed_certificate(), Signers(_usual_signers, refuse=_installed_authority()))
    tls = _find_certificate(named)
    secret, keys = _read_token(named), _read_keys(named)
    if secret is None and tls is None and not keys:
        raise InputError(
            f"{named}: has no readable {TOKEN_NAME} and no {CERTIFICATE_NAME}; name the gateway's data folder, or one that "
            "plumbline keys has made"
        )
    authority = _ask_authority(named / CA_NAME, named / REVOKED_NAME) if (named / CA_NAME).exists() else None
    signers = Signers(partial(_read_keys, named), are_all=bool(keys), refuse=authority)
    return Credentials([] if secret is None else [secret], tls, signers)


def _usual_folders() -> Iterable[Path]:
    """Yield the data folder of the default configuration, the installed one, and those of gateways that this user has run."""
    try:
        yield load(None).gateway.data_dir
        if is_installed():
            yield load_installed().gateway.data_dir
    except PlumblineError:
        pass  # a configuration that this user may not read has no token that this user may read
    yield from known_data_folders()


def gateway_credentials(tls: TlsSection) -> Credentials:
    """Return the usual credentials, but with the certificate of a gateway of this machine where this user may read it."""
    credentials = load_credentials()
    credentials.tls = _readable(tls) or credentials.tls
    return credentials


def _installed_certificate() -> TlsFiles | None:
    """Return the certificate of this machine's gateway, with which it may be asked how it does, where this user may read it."""
    try:
        return _readable(load_installed().bus.tls) if is_installed() else None
    except PlumblineError:
        return None


def _readable(tls: TlsSection) -> TlsFiles | None:
    """Return the certificate of a gateway; None where there is none, or this user may not read it."""
    if tls.ca is None or not all(os.access(path, os.R_OK) for path in tls.files.values()):
        return None
    return TlsFiles(tls.ca, tls.certificate, tls.key)


def _installed_authority() -> RefuseKey | None:
    """Return what this machine's gateway knows of the site's CA, where this user may read it."""
    try:
        tls = load_installed().bus.tls if is_installed() else None
        return None if tls is None or tls.ca is None or not tls.ca.exists() else _ask_authority(tls.ca, tls.revoked)
    except (PlumblineError, OSError):
        return None


def _ask_authority(ca: Path, revoked: Path | None) -> RefuseKey | None:
    """Return what refuses keys for which a CA does not vouch; None without the library, which checks no signature either."""
    if what_is_missing("security") is not None:
        return None
    from gateway.authorization.certificates import SiteAuthority  # noqa: PLC0415 (an extra)

    return SiteAuthority(ca, revoked).refuse


def _find_certificate(folder: Path) -> TlsFiles | None:
    """Return the files in a folder that `plumbline keys` has made."""
    files = TlsFiles(folder / CA_NAME, folder / CERTIFICATE_NAME, folder / "key.pem")
    return files if (folder / CERTIFICATE_NAME).exists() else None


def _sign(tls: TlsFiles, key_expr: str, payload: bytes, challenge: Challenge) -> bytes | None:
    """Return the attachment that proves a request by a certificate. Raises `InputError` for files that cannot be used."""
    require_extra("security")
    from gateway.authorization.certificates import load_key, prove_by_certificate  # noqa: PLC0415 (an extra)

    if tls.certificate is None or tls.key is None:
        return None
    try:
        certificate = tls.certificate.read_text(encoding="ascii")
        key = load_key(tls.key.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"{tls.key.parent}: {error}; issue the certificate again with plumbline keys") from error
    return prove_by_certificate(certificate, key, key_expr, payload, challenge).model_dump_json().encode()


def _usual_signers() -> set[str]:
    """Return the keys of gateways in the usual folders: those of this user, of root and of the service."""
    owners = {0, os.geteuid()}
    with suppress(PlumblineError, OSError):
        owners |= {load_installed().gateway.data_dir.stat().st_uid} if is_installed() else set()
    found = set()
    for folder in _usual_folders():
        with suppress(OSError):
            if (folder / f"{KEY_NAME}{PUBLIC_SUFFIX}").lstat().st_uid in owners:
                found |= _read_keys(folder)
    return found


def _read_keys(folder: Path) -> set[str]:
    """Return the public keys in the files of a folder."""
    found = set()
    for path in folder.glob(f"*{PUBLIC_SUFFIX}"):
        with suppress(KeyFileError):
            found.add(read_public_key(str(path)))
    return found


def _read_token(folder: Path) -> bytes | None:
    try:
        return parse_token(read_bounded(folder / TOKEN_NAME).decode("ascii"))
    except (OSError, UnicodeDecodeError):
        return None
