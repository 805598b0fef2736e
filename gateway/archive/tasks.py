"""The tasks of an archive: which commands of one machine are run over which recordings, and what they answered."""

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from gateway import __version__
from gateway.archive.versions import TRUST_RANK, IndexedFile
from gateway.calibration.record import CalibrationRecord

TaskKind = Literal["verify", "replay", "measure", "reconcile"]


@dataclass(frozen=True, slots=True)
class Task:
    """A command over recordings of one gateway, in the order of their times."""

    kind: TaskKind
    files: tuple[IndexedFile, ...]
    calibration: CalibrationRecord | None = None
    """Of a replay: in place of the recorded ones."""
    software: str = __version__

    @property
    def id(self) -> str:
        """Hash of everything that the answer depends on."""
        other = () if self.calibration is None else (self.calibration.sha256,)
        return _hash_of(self.kind, self.software, self.key, *other, *self._recordings)

    @property
    def subject(self) -> str:
        """Hash of the recordings: by it the answers of several versions and calibrations are compared."""
        return _hash_of(*self._recordings)

    @property
    def _recordings(self) -> tuple[str, ...]:
        return tuple(file.recording for file in self.files)

    @property
    def key(self) -> str:
        """The known public key of the gateway; empty: none is known."""
        return self.files[-1].row.given_key

    @property
    def origin(self) -> IndexedFile:
        """The first file, with the trust of the one that is worth least."""
        least = min(self.files, key=lambda file: TRUST_RANK[file.trust])
        return replace(self.files[0], trust=least.trust)

    def command(self, paths: Sequence[str], calibration: str) -> list[str]:
        """Return the arguments of the command, for the files and the other calibration in these places."""
        match self.kind:
            case "verify":
                return ["record", "verify", *paths, *(["--key", self.key] if self.key else []), "--json", "-"]
            case "replay":
                other = [] if self.calibration is None else ["--calibration", calibration]
                return ["record", "replay", *paths, *other, "--json", "-"]
            case "measure":
                return ["measure", *paths, "--json", "-"]
            case "reconcile":
                return ["reconcile", *paths, "--jobs", "1", "--json", "-"]

    def verdict(self, content: Any) -> str:
        """Return the answer of the command in a word."""
        match self.kind:
            case "verify":
                return str(content["answer"])
            case "replay":
                return "equal" if content["equal"] else "differs"
            case "measure":
                return str(content["conditions"]["verdict"])
            case "reconcile":
                return str(content["verdict"])


def _hash_of(*parts: str) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def plan_tasks(
    kind: TaskKind, files: Iterable[IndexedFile], calibration: CalibrationRecord | None = None
) -> list[Task]:
    """Return the tasks over the files that count: of all files of a gateway, of those of one start of it, or of each."""

    def group_of(file: IndexedFile) -> object:
        if kind == "verify":
            return file.gateway
        return (file.gateway, file.row.boot_id) if kind == "replay" else file.recording

    groups: dict[object, list[IndexedFile]] = defaultdict(list)
    for file in sorted(files, key=lambda each: (each.gateway or (), each.row.gateway_time_ns, each.row.path)):
        if file.row.status == "counted":
            groups[group_of(file)].append(file)
    return [Task(kind, tuple(group), calibration) for group in groups.values()]
