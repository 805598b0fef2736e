"""The file that names the gateways of a fleet: one a line, as <site>/<crane>/<sensor>, and the name of its certificate."""

from pathlib import Path

from gateway.bus.untrusted import GATEWAY_KEY
from gateway.errors import InputError

KEY_PREFIX = "plumbline/v1/"
MAX_LINE_WORDS = 2


def read_expected(path: Path) -> dict[str, str]:
    """Return the common name of the certificate of each gateway, by key; where the file states none, the name of its crane.

    Raises `InputError` with the line that is wrong.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"{path}: cannot be read ({reason}); name a text file with one gateway a line") from error
    gateways: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        key = words[0] if words[0].startswith(KEY_PREFIX) else KEY_PREFIX + words[0]
        if GATEWAY_KEY.fullmatch(key) is None or len(words) > MAX_LINE_WORDS:
            raise InputError(f"{path}, line {number}: {line.strip()!r} is no gateway; write <site>/<crane>/<sensor>")
        gateways[key] = words[1] if len(words) > 1 else key.split("/")[-2]
    if not gateways:
        raise InputError(f"{path}: names no gateway; write one <site>/<crane>/<sensor> a line")
    return gateways
