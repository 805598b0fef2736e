"""The parts of the data as the result states them: when each begins and ends, and how many samples it has."""

from typing import Literal

from gateway.numerics.stats import true_runs
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.recordings import Recordings, selection_part, test_part
from gateway.twin.reconcile.output.result import DataPart


def list_data_parts(recordings: Recordings) -> tuple[DataPart, ...]:
    """Return what each part of the data served; times count from the first sample of the recording as given."""
    log, held_out = recordings.log, recordings.held_out_as_stamped
    recording: Literal["log", "held_out"] = "log" if recordings.last_third else "held_out"
    fit = DataPart("fit", "log", ((0.0, log.duration_s),), int(log.used.sum()))
    block_s = recordings.block_s
    selection, test = selection_part(held_out, block_s), test_part(held_out, block_s)
    return (
        fit,
        DataPart("selection", recording, _blocks_s(selection, block_s), int(selection.used.sum())),
        DataPart("test", recording, _blocks_s(test, block_s), int(test.used.sum())),
    )


def _blocks_s(part: Observations, block_s: float) -> tuple[tuple[float, float], ...]:
    runs = true_runs(part.used)
    merged: list[tuple[float, float]] = []
    for first, stop in runs:
        from_s, to_s = (float(part.time_s[i] + part.offset_s) for i in (first, stop - 1))
        if merged and from_s - merged[-1][1] < block_s / 2:  # a spike left out does not end a block
            merged[-1] = (merged[-1][0], to_s)
        else:
            merged.append((from_s, to_s))
    return tuple(merged)
