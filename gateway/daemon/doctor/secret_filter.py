"""The removal of secrets from texts that leave the machine: values of telling keys, and the content of the secret files."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

REMOVED = "(removed)"
SECRET_NAME = re.compile(r"password|passwd|passphrase|secret|token|credential|(^|[_-])pin$", re.IGNORECASE)
SECRET_FILES = ("*token*", "*pin", "*secret*", "*.pem", "*.key", "*password*")
PUBLIC_FILES = ("*.pub", "*.crt")
MIN_SECRET_CHARACTERS = 4
"""Fewest characters of a secret. Basis: a choice; a shorter content would remove ordinary words and numbers, and no real secret
is shorter."""
MAX_SECRET_FILE_BYTES = 65536
"""Largest file that is read as a secret. Basis: a choice; keys, certificates and passwords have a few kilobytes."""
PRIVATE_BLOCK = re.compile(r"-----BEGIN [A-Z ]*PRIVATE KEY-----.*?(-----END [A-Z ]*PRIVATE KEY-----|\Z)", re.DOTALL)
ASSIGNMENT = re.compile(
    r"""(?P<name>[\w-]*(?:password|passwd|passphrase|secret|token|credential)[\w-]*["']?\s*[:=]\s*)(?P<value>"[^"]*"|'[^']*'|\S+)""",
    re.IGNORECASE,
)
URL_PASSWORD = re.compile(r"(?<=://)[^\s/@:]*:[^\s/@]+(?=@)")


class SecretFilter:
    """Removes secrets: the lines of secret files, private keys, passwords in addresses and assignments."""

    def __init__(self, secret_files: Iterable[Path]) -> None:
        """Read the secret files; those that this user cannot read contain nothing that this user could leak."""
        values = {line for path in secret_files for line in _secret_lines(path)}
        self._values = sorted(values, key=len, reverse=True)

    def text(self, text: str) -> str:
        """Return a text without secrets."""
        text = PRIVATE_BLOCK.sub(REMOVED, text)
        for value in self._values:
            text = text.replace(value, REMOVED)
        text = URL_PASSWORD.sub(REMOVED, text)
        return ASSIGNMENT.sub(rf"\g<name>{REMOVED}", text)

    def table(self, value: Any) -> Any:
        """Return a nested table in which the values of telling keys are removed."""
        if isinstance(value, dict):
            return {
                key: REMOVED if SECRET_NAME.search(str(key)) and item else self.table(item)
                for key, item in value.items()
            }
        if isinstance(value, list):
            return [self.table(item) for item in value]
        return self.text(value) if isinstance(value, str) else value


def secret_files(folders: Iterable[Path]) -> list[Path]:
    """Return the files of folders whose names promise a secret."""
    found = {path for folder in folders for pattern in SECRET_FILES for path in folder.rglob(pattern) if path.is_file()}
    return sorted(path for path in found if not any(path.match(pattern) for pattern in PUBLIC_FILES))


def _secret_lines(path: Path) -> list[str]:
    try:
        if path.stat().st_size > MAX_SECRET_FILE_BYTES:
            return []
        content = path.read_bytes()
    except OSError:
        return []
    lines = [line.strip() for line in content.decode(errors="replace").splitlines()]
    return [line for line in lines if len(line) >= MIN_SECRET_CHARACTERS and not line.startswith("-----")]
