"""Two simpler methods on the data that `reconcile` uses: the same samples, noise, split and test part.

`python -m tests.benchmarks.real_baselines METHOD LOG --rig RIG` takes the table options of `plumbline reconcile` and prints JSON.
METHOD is `everything`, one least-squares fit of all effects, or `sparse`, sparse regression (wants `pip install pysindy`).
"""

import argparse
import importlib
import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gateway.cli.recording_options import add_interval, add_table_options, interval, table_options
from gateway.errors import InputError
from gateway.measurement.rig_file import read_rig_of_recording
from gateway.measurement.source import read_source
from gateway.measurement.swing import cut_to_free_swing
from gateway.twin.model import TwinRig, model_of
from gateway.twin.reconcile.data.data_checks import check_recording
from gateway.twin.reconcile.data.observations import Observations, Recordings, find_lack_of_test, split_recordings
from gateway.twin.reconcile.data.sensor import with_measured_noise
from tests.blind.baselines.files import Measured, Method

METHODS = ("everything", "sparse")
NEEDS = {"sparse": "pysindy"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Print what a method names, and its gaps."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("method", choices=METHODS)
    parser.add_argument("log", type=Path)
    parser.add_argument("--rig", type=Path, required=True)
    parser.add_argument("--json", choices=["-"], default="-", help="as the commands of Plumbline take it")
    add_interval(parser)
    add_table_options(parser)
    chosen = parser.parse_args(arguments)
    print(json.dumps(_answer(chosen)))


def _answer(chosen: argparse.Namespace) -> dict[str, Any]:
    needed = NEEDS.get(chosen.method)
    if needed is not None and find_spec(needed) is None:
        return {"error": f"{needed} is not installed"}
    try:
        rig, recordings = _prepare(chosen)
    except InputError as refused:
        return {"error": str(refused), "refused": True}
    method: Method = getattr(importlib.import_module(f"tests.blind.baselines.{chosen.method}"), chosen.method)
    return compare(method, rig, recordings)


def _prepare(chosen: argparse.Namespace) -> tuple[TwinRig, Recordings]:
    """Read and split as `plumbline reconcile` does. Raises `InputError` where it would refuse."""
    part, options = interval(chosen), table_options(chosen)
    found = read_rig_of_recording(chosen.rig, [chosen.log], part, options)
    source = cut_to_free_swing(read_source([chosen.log], found.rig, part, options)).source
    rig = with_measured_noise(model_of(found.refined_by(source).rig), source)[0].rig
    checked = check_recording(source, rig)
    if checked.observations is None:
        raise InputError(checked.fault or "no samples")
    recordings = split_recordings(checked.observations, None, rig.small_swing_period_s)
    if (fault := find_lack_of_test(recordings)) is not None:
        raise InputError(fault)
    return rig, recordings


def compare(method: Method, rig: TwinRig, recordings: Recordings) -> dict[str, Any]:
    """What a method names on the log, and its gaps on the test part; nothing is fitted to the test part."""
    found = method(rig, _measured(recordings.log), _measured(recordings.selection))
    return {
        "effects": [{"name": name} for name in found.names],
        "gap": {
            when: {
                "log": log,
                "test": recordings.test.reduced_chi2(prediction_g),
                "held_out": recordings.held_out.reduced_chi2(prediction_g),
            }
            for when, log, prediction_g in zip(
                ("before", "after"), found.log_chi2, (found.base_prediction_g, found.prediction_g), strict=True
            )
        },
    }


def _measured(observations: Observations) -> Measured:
    return Measured(
        observations.time_s,
        observations.force_g,
        observations.temperature_c,
        observations.noise_g,
        observations.used,
        observations.offset_s,
    )


if __name__ == "__main__":
    main()
