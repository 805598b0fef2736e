"""The upload of finished, signed segments from a gateway's data folder, a process of its own that only reads there.

Names contain the hash of the content and are written once: whoever holds the gateway's rights can add to the store and change
nothing in it. What is there already is not sent again, so that an upload that was ended goes on where it was.
"""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, time, timedelta
from pathlib import Path

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError
from obstore.store import LocalStore, ObjectStore

from devices.errors import RecordingError
from gateway.archive.source import DELETED, SUFFIX, open_object_store, reason_of_store
from gateway.bus.untrusted import GATEWAY_KEY
from gateway.errors import InputError
from gateway.file_input import read_toml
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.segments.events import UNCOMPACTED
from gateway.topics import KEY_PREFIX


@dataclass(frozen=True, slots=True)
class TimeWindow:
    """A time of the day, in this computer's time zone; it may go over midnight."""

    begin: time
    end: time

    def wait_s(self, now: datetime) -> float:
        """Return the time until it is open; 0: it is."""
        clock = now.time()
        is_open = self.begin <= clock < self.end if self.begin < self.end else not self.end <= clock < self.begin
        if is_open:
            return 0.0
        opens = datetime.combine(now.date(), self.begin, now.tzinfo)
        return ((opens if opens > now else opens + timedelta(days=1)) - now).total_seconds()


def parse_window(text: str) -> TimeWindow:
    """Parse `22:00-05:00`. Raises `ValueError`."""
    begin, _, end = text.partition("-")
    try:
        window = TimeWindow(time.fromisoformat(begin.strip()), time.fromisoformat(end.strip()))
    except ValueError:
        raise ValueError(f"{text} is no time of the day such as 22:00-05:00") from None
    if window.begin == window.end:
        raise ValueError(f"{text} is never open; give two times such as 22:00-05:00")
    return window


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """When and how fast is sent."""

    rate_bytes_s: float | None = None
    """Mean rate; a segment is sent in one go, and the pause after it makes up for that. None: without limit."""
    window: TimeWindow | None = None


@dataclass(frozen=True, slots=True)
class UploadResult:
    """What came of a pass over the folder."""

    sent: int
    sent_bytes: int
    present: int
    """Segments that were there already, or were deleted there."""
    left: int
    """Finished segments that are not there yet: the window has closed."""
    unfinished: int
    """Segments that are being written, or wait to be rewritten and signed as a whole."""
    refused: tuple[str, ...]
    """Segments that differ from what was signed, with the reason."""


def open_destination(name: str, credentials: Path | None) -> ObjectStore:
    """Return the store of a folder, which is made, or of a URL. Raises `InputError`.

    `credentials`: a TOML file with the settings of the store, such as aws_access_key_id, that its owner alone may read.
    """
    settings = {} if credentials is None else _read_credentials(credentials)
    if "://" in name:
        return open_object_store(name, settings)
    if settings:
        raise InputError(f"--credentials {credentials}: a folder needs none; leave it out")
    try:
        return LocalStore(name, mkdir=True)
    except (BaseError, OSError) as error:
        raise InputError(f"{name}: cannot be made ({reason_of_store(error)}); choose another folder") from error


def _read_credentials(path: Path) -> dict[str, str]:
    try:
        is_private = not path.stat().st_mode & 0o077
        content = read_toml(path) if is_private else {}
    except (OSError, ValueError) as error:
        raise InputError(f"--credentials {path}: cannot be read ({error}); give a TOML file") from error
    if not is_private:
        raise InputError(f"--credentials {path}: others may read it; chmod 600 {path}")
    if not all(isinstance(value, str) for value in content.values()):
        raise InputError(f'--credentials {path}: has more than texts; write lines such as aws_region = "eu-central-1"')
    return content


class Uploader:
    """Sends what is new in a folder; it remembers the hashes of files for the next pass."""

    def __init__(
        self,
        folder: Path,
        store: ObjectStore,
        limits: UploadLimits,
        now: Callable[[], datetime],
        sleep: Callable[[float], object],
    ) -> None:
        """`now` returns the local time; `sleep` waits for seconds."""
        self._folder = folder
        self._store = store
        self._limits = limits
        self._now = now
        self._sleep = sleep
        self._names: dict[tuple[str, int, int], str] = {}
        """Names in the store, by name, size and time of the files."""

    def run(self, told: Callable[[str], object]) -> UploadResult:
        """Send what is finished and not there; `told` takes a line for each segment that was sent. Raises `InputError`."""
        sent = sent_bytes = present = left = unfinished = 0
        refused: list[str] = []
        known = set(self._list())
        for path in sorted(self._folder.glob(f"*{SUFFIX}")):
            if path.with_name(path.name + UNCOMPACTED).exists():
                unfinished += 1
                continue
            try:
                name = self._name(path)
            except (RecordingError, OSError) as error:
                refused.append(str(error))
                continue
            if name is None:
                unfinished += 1
            elif not known.isdisjoint((name, name + DELETED)):
                present += 1
            elif self._limits.window is not None and self._limits.window.wait_s(self._now()):
                left += 1
            elif size_bytes := self._send(path, name):
                sent, sent_bytes = sent + 1, sent_bytes + size_bytes
                told(f"{path.name}: sent as {name}")
            else:
                present += 1
        return UploadResult(sent, sent_bytes, present, left, unfinished, tuple(refused))

    def _list(self) -> Iterator[str]:
        try:
            for chunk in obstore.list(self._store):
                yield from (meta["path"] for meta in chunk)
        except (BaseError, OSError) as error:
            raise InputError(f"the store cannot be listed ({reason_of_store(error)}); try again later") from error

    def _name(self, path: Path) -> str | None:
        """Return the name of a finished segment in the store; None: it is not finished. Raises `RecordingError`."""
        state = path.stat()
        key = path.name, state.st_size, state.st_mtime_ns
        if key not in self._names:
            found = verify_file(path, None)
            if found.problems:
                raise RecordingError(f"{path}: {found.problems[0]}")
            if found.copy:
                raise RecordingError(f"{path}: is {found.copy}, and no recording of the gateway")
            if not found.is_final or found.statement is None:
                return None
            if GATEWAY_KEY.fullmatch(KEY_PREFIX + found.statement.gateway.removeprefix(KEY_PREFIX)) is None:
                raise RecordingError(f"{path}: is signed for {found.statement.gateway}, which is no gateway")
            with path.open("rb") as file:
                sha256 = hashlib.file_digest(file, "sha256").hexdigest()
            gateway = found.statement.gateway.removeprefix(KEY_PREFIX)
            self._names[key] = f"{gateway}/{path.stem}-{sha256}{SUFFIX}"
        return self._names[key]

    def _send(self, path: Path, name: str) -> int:
        """Send a segment; return its size, 0 where somebody has sent it meanwhile. Raises `InputError`."""
        content = path.read_bytes()
        if hashlib.sha256(content).hexdigest() not in name:  # rewritten meanwhile: the next pass sends it
            return 0
        begin = self._now()
        try:
            obstore.put(self._store, name, content, mode="create", use_multipart=False)
        except AlreadyExistsError:
            return 0
        except (BaseError, OSError) as error:
            raise InputError(
                f"{path.name}: cannot be sent ({reason_of_store(error)}); what was sent remains"
            ) from error
        if self._limits.rate_bytes_s is not None:
            lasted_s = (self._now() - begin).total_seconds()
            self._sleep(max(len(content) / self._limits.rate_bytes_s - lasted_s, 0.0))
        return len(content)
