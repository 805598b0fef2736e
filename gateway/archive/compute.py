"""The run of tasks over an archive, on this machine or on the workers of a Dask cluster.

Results are in the table within seconds. What has a result is not done again: a run that was ended goes on where it was.
"""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED as FIRST
from concurrent.futures import Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pyarrow as pa

from gateway.archive.rows import RECORDINGS, RESULTS, ResultRow, row_of
from gateway.archive.tables import Archive, partition_of, row_places, select, sql_in, table_of
from gateway.archive.tasks import PROCESSES, Task, TaskKind, TaskLimits, TaskOutcome, plan_tasks, run_task
from gateway.calibration.record import CalibrationRecord
from gateway.errors import InputError
from gateway.recording.reading.timeline import ReportProgress, ignore_progress

FLUSH_S = 5.0
"""Results are written so often. Basis: a choice; a person sees them come, and a transaction costs a tenth of a second."""
CONNECT_S = 30
"""Longest wait for the scheduler of a cluster. Basis: a choice; what a person waits."""
WORKER_DEATHS = 3
"""A task whose worker has died so often is poison. Basis: as the attempts of a task."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Where tasks are run."""

    processes: int = 1
    """On this machine."""
    cluster: str | None = None
    """Address of the scheduler of a Dask cluster; None: on this machine."""


@dataclass(slots=True)
class ComputeResult:
    """What a run has done."""

    planned: int
    known: int
    """Tasks that had a result already."""
    verdicts: Counter[str] = field(default_factory=Counter)
    failed: list[tuple[Task, TaskOutcome]] = field(default_factory=list)
    """Those that were refused or are poison."""

    def add(self, task: Task, outcome: TaskOutcome) -> None:
        """Count an outcome."""
        self.verdicts[outcome.verdict or outcome.state] += 1
        if outcome.state != "done":
            self.failed.append((task, outcome))


def compute(
    archive: Archive,
    source_name: str,
    kind: TaskKind,
    workers: Workers,
    limits: TaskLimits,
    *,
    calibration: CalibrationRecord | None = None,
    again: bool = False,
    report: ReportProgress = ignore_progress,
) -> ComputeResult:
    """Run the tasks of a kind that have no result; `again`: also those that failed. Raises `InputError` and `ArchiveError`.

    With another calibration: those over recordings of its device.
    """
    planned = plan_tasks(kind, archive.files(archive.open(RECORDINGS)), calibration)
    archive.create()  # a table of an older version lacks columns
    if calibration is not None:
        planned = _of_device(archive, planned, calibration)
    known = _known(archive, kind, with_failed=not again)
    tasks = [task for task in planned if task.id not in known]
    result = ComputeResult(len(planned), len(planned) - len(tasks))
    written_s, waiting = time.monotonic(), list[tuple[Task, TaskOutcome]]()
    try:
        with _executor(workers) as executor:
            for number, (task, outcome) in enumerate(_outcomes(executor, source_name, tasks, limits), 1):
                waiting.append((task, outcome))
                result.add(task, outcome)
                if time.monotonic() - written_s > FLUSH_S:
                    _write(archive, waiting)
                    written_s, waiting = time.monotonic(), []
                report(number / len(tasks))
    finally:
        _write(archive, waiting)
    return result


def _of_device(archive: Archive, tasks: Sequence[Task], calibration: CalibrationRecord) -> list[Task]:
    """Return the tasks over recordings of the device of a calibration. Raises `InputError` where there are none."""
    own = select(archive.open("calibrations"), "recording", sql_in("device_id", [calibration.device_id]))
    recordings = set(own["recording"].to_pylist())
    found = [task for task in tasks if any(file.recording in recordings for file in task.files)]
    if not found:
        raise InputError(f"{calibration.id}: no recording is of its device, {calibration.device_id}; give another one")
    return found


def _known(archive: Archive, kind: TaskKind, *, with_failed: bool) -> set[str]:
    """Return the tasks that have a result."""
    chosen = f"kind = '{kind}'" + ("" if with_failed else " AND state = 'done'")
    return set(select(archive.open(RESULTS), "task", chosen)["task"].to_pylist())


@contextmanager
def _executor(workers: Workers) -> Iterator[Executor]:
    if workers.cluster is None:
        PROCESSES.begin()
        threads = ThreadPoolExecutor(workers.processes)  # each waits for a process
        try:
            yield threads
        finally:
            PROCESSES.stop()
            threads.shutdown(cancel_futures=True)
        return
    from distributed import Client  # noqa: PLC0415  (an extra)

    connect: Any = Client  # it has no types
    try:
        client = connect(workers.cluster, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--cluster {workers.cluster}: no scheduler answers ({error}); start dask scheduler"
        ) from error
    with client:
        yield client.get_executor(pure=False, retries=WORKER_DEATHS)


def _outcomes(
    executor: Executor, source_name: str, tasks: Sequence[Task], limits: TaskLimits
) -> Iterator[tuple[Task, TaskOutcome]]:
    """Yield the outcomes as they come."""
    running: dict[Future[TaskOutcome], Task] = {
        executor.submit(run_task, source_name, task, limits): task for task in tasks
    }
    while running:
        for future in wait(running, return_when=FIRST).done:
            task = running.pop(future)
            error = future.exception()
            yield task, TaskOutcome("poison", reason=f"its workers died: {error}") if error else future.result()


def _write(archive: Archive, outcomes: Sequence[tuple[Task, TaskOutcome]]) -> None:
    """Put results into the table, in one transaction."""
    if not outcomes:
        return
    writers = {"/".join(task.origin.gateway or ()) for task, _ in outcomes}
    months = [partition_of(RESULTS, task.origin) for task, _ in outcomes]
    rows = pa.concat_tables([_row(task, outcome) for task, outcome in outcomes])
    archive.exchange(RESULTS, row_places(RESULTS, writers, [task.id for task, _ in outcomes], months), rows)


def _row(task: Task, outcome: TaskOutcome) -> pa.Table:
    first = task.origin
    row = row_of(
        ResultRow,
        outcome,
        gateway_time_ns=first.row.gateway_time_ns,
        kind=task.kind,
        task=task.id,
        software=task.software,
        recordings=len(task.files),
        subject=task.subject,
        calibration=None if task.calibration is None else task.calibration.id,
    )
    return table_of(RESULTS, [row], first, first.utc_ns - first.row.gateway_time_ns)
