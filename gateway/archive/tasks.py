"""The tasks of an archive: which commands of one machine are run over which recordings, and what they answered.

Each runs in a process of its own, whose time and memory are limited: what it breaks, it breaks alone. This is what a worker of a
cluster does; it needs the source and this program, and nothing else.
"""

import hashlib
import os
import shlex
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from gateway import __version__
from gateway.archive.rows import TRUST_RANK, IndexedFile, TaskState
from gateway.archive.source import open_source
from gateway.calibration.record import CalibrationRecord
from gateway.errors import ANSWER_IS_NO, BAD_INPUT, WITH_LOSSES, InputError
from gateway.file_input import parse_json

TaskKind = Literal["verify", "replay", "measure", "reconcile"]
ANSWERS = (0, ANSWER_IS_NO, WITH_LOSSES)
MAX_REASON_CHARACTERS = 500
"""Basis: a choice; some lines of an error."""
KB_PER_MB = 1024
"""Definition: `ulimit` counts in units of 1024 bytes."""


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
                answer = str(content["answer"])
                return "genuine" if answer == "extract" else answer  # the files of an archive are always named
            case "replay":
                if not content.get("is_compared", True):
                    return "not_compared"
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


@dataclass(frozen=True, slots=True)
class TaskLimits:
    """What a task may take."""

    time_s: float = 3600.0
    memory_mb: int = 4096
    """Of address space, which is more than what is used: numerical libraries reserve a gigabyte."""
    attempts: int = 3


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """What came of a task."""

    state: TaskState
    verdict: str = ""
    reason: str = ""
    content: str = ""
    attempts: int = 1
    duration_s: float = 0.0
    """Of the last attempt."""


class TaskProcesses:
    """The processes of this machine, so that they can be ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[str]] = set()
        self._is_stopped = False

    def run(self, command: Sequence[str], time_s: float) -> tuple[int, str, str]:
        """Return exit code, output and errors of a command. Raises `subprocess.TimeoutExpired`."""
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # one core a task
        with self._lock:
            if self._is_stopped:
                return -1, "", "stopped"
            process = subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env=environment,
                start_new_session=True,  # Ctrl-C is for the run alone: `reconcile` would take it for a wish to answer early
            )
            self._running.add(process)
        try:
            with process:
                try:
                    output, errors = process.communicate(timeout=time_s)
                finally:
                    process.kill()
        finally:
            with self._lock:
                self._running.discard(process)
        return process.returncode, output, errors

    def begin(self) -> None:
        """Run tasks from now on."""
        with self._lock:
            self._is_stopped = False

    def stop(self) -> None:
        """End all of them, and begin no other one."""
        with self._lock:
            self._is_stopped = True
            for process in self._running:
                process.kill()


PROCESSES = TaskProcesses()


def run_task(source_name: str, task: Task, limits: TaskLimits) -> TaskOutcome:
    """Run a task; what kills it or takes too much is tried again, and is poison after the last attempt."""
    if task.software != __version__:
        return TaskOutcome("refused", reason=f"the worker has version {__version__}; install {task.software} there")
    outcome = TaskOutcome("poison")
    for attempt in range(1, limits.attempts + 1):
        begin_s = time.monotonic()
        try:
            with ExitStack() as stack:
                source = open_source(source_name)
                paths = [str(stack.enter_context(source.local(file.row.path))) for file in task.files]
                outcome = _attempt(task.command(paths, _calibration_file(task, stack)), task, limits)
        except InputError as error:
            outcome = TaskOutcome("refused", reason=str(error))
        except subprocess.TimeoutExpired:
            outcome = TaskOutcome("poison", reason=f"took longer than {limits.time_s:g} s")
        lasted_s = time.monotonic() - begin_s
        outcome = replace(outcome, attempts=attempt, duration_s=lasted_s)
        if outcome.state != "poison":
            break
    return outcome


def _calibration_file(task: Task, stack: ExitStack) -> str:
    """Write the other calibration of a task, if it has one, for the time of the stack, and return its place."""
    if task.calibration is None:
        return ""
    path = Path(stack.enter_context(TemporaryDirectory(prefix="plumbline-"))) / "calibration.json"
    path.write_text(task.calibration.model_dump_json())
    return str(path)


def _attempt(command: Sequence[str], task: Task, limits: TaskLimits) -> TaskOutcome:
    program = [sys.executable, "-m", "gateway", *command]
    limited = ["sh", "-c", f"ulimit -v {limits.memory_mb * KB_PER_MB}; exec {shlex.join(program)}"]
    code, output, errors = PROCESSES.run(limited, limits.time_s)
    last_line = errors.strip().rpartition("\n")[2][:MAX_REASON_CHARACTERS]
    if code == BAD_INPUT:
        return TaskOutcome("refused", reason=last_line)
    try:
        content = parse_json(output) if code in ANSWERS else None
        verdict = "" if content is None else task.verdict(content)
    except (ValueError, KeyError, TypeError):
        content = None
    if content is None:
        return TaskOutcome("poison", reason=f"ended with code {code}: {last_line or 'without a word'}")
    return TaskOutcome("done", verdict, "", output)
