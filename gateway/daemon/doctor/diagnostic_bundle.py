"""The diagnostic bundle: what a service engineer needs from a machine that is far away, in one file and without secrets."""

import io
import json
import platform
import re
import stat
import subprocess
import tarfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from gateway import __version__
from gateway.configuration.loading import SETTINGS
from gateway.configuration.model import Configuration
from gateway.daemon.doctor import CheckResult
from gateway.daemon.doctor.service_check import query_gateway
from gateway.errors import PlumblineError
from gateway.file_input import read_owned

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
UNIT = "plumbline.service"
LOG_LINES = 2000
"""Lines of the log, the newest. Basis: a choice; several starts of a gateway, and a bundle that a mail can carry."""
AUDIT_LINES = 200
"""Lines of the audit, the newest. Basis: a choice; more than the changes of a month, and a bundle that a mail can carry."""
MAX_LISTED_FILES = 5000
"""Files that are listed, the newest. Basis: a choice; more than a quota of segments, and a bound of the list."""
COMMAND_S = 10.0
"""Longest time of a command of the system. Basis: a choice; these commands take a second, and one that hangs holds up the
bundle."""
NOT_KNOWN = "not known"


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


def make_bundle(configuration: Configuration, results: list[CheckResult]) -> bytes:
    """Return the bundle as a compressed tar file."""
    data_dir = configuration.gateway.data_dir
    folders = [folder for folder in (data_dir, SETTINGS.parent) if folder.is_dir()]
    configured = [configuration.recorder.key, *configuration.bus.tls.files.values()]
    keys = [path for path in configured if path is not None and path.suffix != ".crt"]
    secrets = SecretFilter([*secret_files(folders), *keys])
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as archive:
        for name, text in _parts(configuration, results, secrets):
            content = secrets.text(text).encode(errors="replace")
            entry = tarfile.TarInfo(f"plumbline-diagnostics/{name}")
            entry.size, entry.mtime, entry.mode = len(content), int(time.time()), 0o640
            archive.addfile(entry, io.BytesIO(content))
    return buffer.getvalue()


def _parts(
    configuration: Configuration, results: list[CheckResult], secrets: SecretFilter
) -> Iterator[tuple[str, str]]:
    data_dir = configuration.gateway.data_dir
    yield "doctor.json", _json([asdict(result) for result in results])
    yield "versions.json", _json(_versions())
    yield "configuration.json", _json(secrets.table(configuration.model_dump(mode="json")))
    yield "status.json", _json(secrets.table(_status(configuration)))
    yield (
        "unit.txt",
        _output("systemctl", "show", UNIT) + _output("systemctl", "status", "--no-pager", "--lines=0", UNIT),
    )
    yield (
        "log.txt",
        _output("journalctl", "--unit", UNIT, "--lines", str(LOG_LINES), "--no-pager", "--output=short-iso"),
    )
    yield "audit.jsonl", _last_lines(data_dir, "calibration/audit.jsonl")
    yield "files.txt", _listing(data_dir)


def _json(content: Any) -> str:
    return json.dumps(content, indent=1, default=str) + "\n"


def _versions() -> dict[str, Any]:
    try:
        system = platform.freedesktop_os_release().get("PRETTY_NAME", NOT_KNOWN)
    except OSError:
        system = NOT_KNOWN
    return {
        "created_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "software": __version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "kernel": platform.release(),
        "system": system,
        "distributions": dict(sorted((entry.name, entry.version) for entry in metadata.distributions())),
    }


def _status(configuration: Configuration) -> dict[str, Any]:
    """Return the last message of every topic of the gateway, or why it could not be asked."""
    try:
        answer = query_gateway(configuration)
    except PlumblineError as error:
        return {"error": str(error)}
    return {"error": "the gateway does not answer"} if answer is None else answer.topics


def _output(*command: str) -> str:
    """Return what a command of the system prints, or why it could not be run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=COMMAND_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{command[0]}: {error}\n"
    return done.stdout + done.stderr


def _last_lines(folder: Path, name: str) -> str:
    try:
        lines = read_owned(folder, name).decode(errors="replace").splitlines()[-AUDIT_LINES:]
    except OSError as error:
        return f"{folder / name}: {error.strerror}; it is not in the bundle\n"
    return "\n".join(lines) + "\n"


def _listing(folder: Path) -> str:
    """Return name, size and time of the files of a folder, the newest first."""
    files = []
    for path in folder.rglob("*"):
        try:
            state = path.lstat()
        except OSError:
            continue
        if stat.S_ISREG(state.st_mode):
            files.append((state.st_mtime, state.st_size, path.relative_to(folder)))
    files.sort(reverse=True)
    lines = [
        f"{datetime.fromtimestamp(modified_s, UTC).isoformat(timespec='seconds')} {size_bytes:>12} {name}"
        for modified_s, size_bytes, name in files[:MAX_LISTED_FILES]
    ]
    return "\n".join([f"{len(files)} files in {folder}", *lines]) + "\n"
