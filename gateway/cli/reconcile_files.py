"""What `plumbline reconcile` writes: checked before the work begins, and all of it made before any of it is written."""

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.errors import InputError

if TYPE_CHECKING:
    from gateway.twin.reconcile.output.result import Curves, Reconciliation


def check_outputs(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None]) -> None:
    """Raises `InputError` where an output has no place to be, or would take that of an input or of another output."""
    taken = {path.resolve(): name for name, path in inputs.items() if path is not None}
    for name, path in outputs.items():
        if path is None:
            continue
        fault = _fault(path)
        if fault:
            raise InputError(f"{name} {path}: cannot be written ({fault}); choose another place")
        other = taken.setdefault(path.resolve(), name)
        if other != name:
            raise InputError(f"{name} {path}: is {other}, too; give it another name")


def _fault(path: Path) -> str:
    if path.is_dir():
        return "it is a directory"
    if not path.parent.is_dir():
        return f"there is no directory {path.parent}"
    return "" if os.access(path.parent, os.W_OK) else f"no permission in {path.parent}"


def texts(arguments: argparse.Namespace, result: "Reconciliation", runtime_s: float) -> dict[Path, str]:
    """Prediction, model and report as far as they were asked for, by their places."""
    from gateway.twin.reconcile.output.export import format_model_toml

    made = {}
    if arguments.prediction is not None:
        made[arguments.prediction] = _prediction(result, of_second=arguments.held_out is not None)
    if arguments.write_model is not None:
        made[arguments.write_model] = format_model_toml(result)
    if arguments.report is not None:
        made[arguments.report] = _report(arguments, result, runtime_s)
    return made


def _prediction(result: "Reconciliation", *, of_second: bool) -> str:
    """Of the held-out recording, or of the log in its two parts."""
    from gateway.twin.reconcile.output.export import format_prediction_csv

    curves: list[Curves | None] = [result.held_out] if of_second else [result.log, result.held_out]
    return format_prediction_csv([each for each in curves if each is not None])


def _report(arguments: argparse.Namespace, result: "Reconciliation", runtime_s: float) -> str:
    from gateway import __version__
    from gateway.twin.report.page import render_report

    computed = {"recording": str(arguments.log)}
    computed["rig"] = "as the recording brings it" if arguments.rig is None else str(arguments.rig)
    computed["held out"] = "the recording’s last third" if arguments.held_out is None else str(arguments.held_out)
    computed |= {"seed": str(arguments.seed), "time": f"{runtime_s:.1f} s"}
    return render_report(
        result, title=f"Reconciliation of {arguments.log.name}", software=f"plumbline {__version__}", computed=computed
    )
