"""By which key recordings are judged: the one that is given, that this user has heard, or for which the site's CA vouches."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command import option
from gateway.cli.recording_options import refusal_by

if TYPE_CHECKING:
    from gateway.messages import NewestStatement
    from gateway.recording.chain.chain_verification import VouchedKey


class _OneKey(argparse.Action):
    """Takes one key: a second one would say of the recordings of which gateway it is, and the first one would be lost."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, flag: str | None = None
    ) -> None:
        if getattr(namespace, self.dest) is not None:
            parser.error(f"{flag} is given twice; verify the recordings of each gateway by themselves, with its key")
        setattr(namespace, self.dest, values)


KEY_OPTION = option(
    "--key",
    action=_OneKey,
    metavar="PUBLIC",
    help="the gateway's public key: 64 hexadecimal digits, or the file signing-key.pem.pub, kept apart from the recordings",
)


@dataclass(frozen=True, slots=True)
class KnownKey:
    """The key, and who says that it is the gateway's."""

    given: str | None
    heard: "NewestStatement | None"
    """What this user has heard of the gateway, its key at the first contact."""
    vouched: "VouchedKey | None"
    """What the CA says; None: it is not to be asked."""
    remark: str = ""
    """Why the key that is given is not believed; empty: it is, or none is given."""

    @property
    def public_key(self) -> str | None:
        """The key; None: none is known."""
        pinned = None if self.heard is None else self.heard.public_key
        return self.given or pinned or (None if self.vouched is None else self.vouched.public_key)

    @property
    def is_pinned(self) -> bool:
        """Whether the first contact alone says that it is the gateway's."""
        return self.given is None and self.heard is not None

    @property
    def phrase(self) -> str:
        """The key by its fingerprint, and who says that it is the gateway's; empty where none is known."""
        from gateway.pki.signing_key import fingerprint

        if self.public_key is None:
            return ""
        how = "given" if self.given else "vouched for by the site's CA"
        if self.is_pinned:
            how = "pinned: this user heard it from the gateway at the first contact"
        return f"key {fingerprint(self.public_key)}, {how}"

    @property
    def said_by(self) -> str:
        """The key, and who says that it is the gateway's, as a sentence; empty where none is known."""
        if self.public_key is None:
            return ""
        if self.given is not None:
            how = "gave this key, from outside the folder of the recordings"
        elif self.is_pinned or self.vouched is None:
            how = "heard this key from the gateway at the first contact"
        else:
            return f"The site’s CA vouches for this key of {self.vouched.gateway}: {self.public_key}."
        return f"Who made this report {how}: {self.public_key}."


def key_of_recordings(given: str | None, ca: Path | None, paths: Sequence[Path]) -> KnownKey:
    """Return the key for recordings in order of time.

    Raises `InputError` and `KeyFileError` for an option that cannot be read, `RecordingError` for a recording.
    """
    from gateway.bus.known_gateways import known_statement
    from gateway.pki.signing_key import read_public_key
    from gateway.recording.chain.chain_verification import find_vouched_key

    key, remark = (None if given is None else read_public_key(given)), ""
    if given is not None and Path(given).is_file() and _lies_with(Path(given), paths):
        key = None
        remark = f"the key {given} lies with the recordings, and proves nothing of who wrote both: keep it apart"
    return KnownKey(
        given=key,
        remark=remark,
        heard=known_statement(_gateway_of(paths[0])) if paths else None,
        vouched=None if ca is None else find_vouched_key(paths, refusal_by(ca)),
    )


def _lies_with(file: Path, paths: Sequence[Path]) -> bool:
    return file.resolve().parent in {path.resolve().parent for path in paths}


def _gateway_of(path: Path) -> str:
    """Return the gateway that a statement in a file names; its signature is checked later."""
    from gateway.recording.chain.statements import SIGNATURE, parse_statement
    from gateway.recording.reading.recording_file import read_index

    statement = parse_statement(read_index(path).metadata.get(SIGNATURE, {}).get("statement", ""))
    return "" if statement is None else statement.gateway
