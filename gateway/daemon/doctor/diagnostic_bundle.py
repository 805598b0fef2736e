"""The diagnostic bundle: what a service engineer needs from a machine that is far away, in one file and without secrets."""

import io
import json
import platform
import stat
import subprocess
import tarfile
import time
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from gateway import __version__
from gateway.configuration.loading import SETTINGS
from gateway.configuration.model import Configuration
from gateway.daemon.doctor.check_result import CheckResult
from gateway.daemon.doctor.secret_filter import SecretFilter, secret_files
from gateway.daemon.doctor.service_check import query_gateway
from gateway.errors import PlumblineError
from gateway.file_input import read_owned

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
