"""The recordings of an archive: a folder, or an object store such as `s3://bucket/prefix`."""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import obstore
from obstore.exceptions import BaseError
from obstore.store import LocalStore, ObjectStore, from_url

from gateway.errors import InputError

if TYPE_CHECKING:
    from obstore.store import RetryConfig

SUFFIX = ".mcap"
DELETED = ".deleted"
"""Behind the name of a recording: an empty object that keeps the recording from being uploaded again."""
PATIENT: "RetryConfig" = {
    "max_retries": 8,
    "retry_timeout": timedelta(seconds=30),
    "backoff": {"init_backoff": timedelta(seconds=0.1), "max_backoff": timedelta(seconds=5), "base": 2},
}
"""How a request is repeated. Basis: a choice; a mobile link is back after seconds, and a person waits half a minute."""


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A recording of a source, by its name within it."""

    path: str
    size_bytes: int
    version: str
    """Differs between two contents of the same name: the store's ETag, or place, size and time of a file."""


@dataclass(frozen=True, slots=True)
class RecordingSource:
    """A place of recordings."""

    name: str
    store: ObjectStore
    folder: Path | None = None
    """None: an object store, whose files are copied before they are read."""

    def list(self) -> list[StoredFile]:
        """Return the recordings, in the order of their names. Raises `InputError` where the place cannot be read."""
        try:
            found = [meta for chunk in obstore.list(self.store) for meta in chunk if meta["path"].endswith(SUFFIX)]
        except (BaseError, OSError) as error:
            raise InputError(
                f"{self.name}: cannot be listed ({reason_of_store(error)}); check name and rights"
            ) from error
        files = [
            StoredFile(meta["path"], meta["size"], meta["e_tag"] or meta["last_modified"].isoformat()) for meta in found
        ]
        return sorted(files, key=lambda file: file.path)

    @contextmanager
    def local(self, name: str) -> Iterator[Path]:
        """Yield the path of a recording on this machine, for the length of the block. Raises `InputError`."""
        if self.folder is not None:
            yield self.folder / name
            return
        with tempfile.TemporaryDirectory(prefix="plumbline-") as folder:
            copy = Path(folder) / Path(name).name
            try:
                with copy.open("wb") as out:
                    for part in obstore.get(self.store, name).stream():
                        out.write(part)
            except BaseError as error:
                raise InputError(f"{self.name}/{name}: cannot be read ({reason_of_store(error)})") from error
            yield copy


def open_source(name: str) -> RecordingSource:
    """Return the source of a folder, or of a URL such as `s3://bucket/prefix`. Raises `InputError`.

    Endpoint, region and credentials of an object store are those of its usual environment, such as `AWS_ENDPOINT_URL`.
    """
    if "://" in name:
        return RecordingSource(name, open_object_store(name, {}))
    folder = Path(name)
    if not folder.is_dir():
        raise InputError(f"{name}: is no folder; give one with recordings, or a URL such as s3://bucket/prefix")
    return RecordingSource(name, LocalStore(folder.resolve()), folder)


def open_object_store(url: str, settings: Mapping[str, str]) -> ObjectStore:
    """Return the store of a URL, with settings beside those of the environment. Raises `InputError`."""
    config: Any = dict(settings) or None  # the store checks its keys
    is_plain = any(value.startswith("http://") for value in settings.values())  # an endpoint that was named so
    try:
        return from_url(
            url, config=config, client_options={"allow_http": True} if is_plain else None, retry_config=PATIENT
        )
    except (BaseError, ValueError) as error:
        raise InputError(f"{url}: is no object store that can be used ({reason_of_store(error)})") from error


def reason_of_store(error: Exception) -> str:
    """Return the first line of what a store says."""
    return str(error).strip().partition("\n")[0]
