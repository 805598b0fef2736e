"""The file that names the gateways that must be there: one a line, as <site>/<crane>/<sensor>."""

from pathlib import Path

from gateway.bus.fleet_inbox import KEY
from gateway.errors import InputError

PREFIX = "plumbline/v1/"


def read_expected(path: Path) -> frozenset[str]:
    """Return the keys of the expected gateways. Raises `InputError` with the line that is wrong."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise InputError(f"{path}: cannot be read ({reason}); --expect needs a text file") from error
    keys: set[str] = set()
    for number, line in enumerate(lines, start=1):
        name = line.partition("#")[0].strip()
        if not name:
            continue
        key = name if name.startswith(PREFIX) else PREFIX + name
        if KEY.fullmatch(key) is None:
            raise InputError(f"{path}, line {number}: {name!r} is no gateway; write <site>/<crane>/<sensor>")
        keys.add(key)
    if not keys:
        raise InputError(f"{path}: names no gateway; write one <site>/<crane>/<sensor> a line")
    return frozenset(keys)
