"""The output files of `plumbline reconcile`: none takes the place of another, and all are made before one is written."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.terminal.output import STANDARD_OUTPUT
from gateway.errors import InputError

if TYPE_CHECKING:
    from gateway.measurement.source import Source
    from gateway.twin.reconcile.output.result import Curves, Reconciliation


def check_outputs(outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None]) -> None:
    """Raise `InputError` if an output would replace an input or another output."""
    used = {path.resolve(): name for name, path in inputs.items() if path is not None}
    for name, path in outputs.items():
        if path is None or path == STANDARD_OUTPUT:
            continue
        other = used.setdefault(path.resolve(), name)
        if other != name:
            raise InputError(f"{name} {path}: is {other} as well; choose another name")


def output_texts(
    arguments: argparse.Namespace, result: "Reconciliation", runtime_s: float, predicted: "Source"
) -> dict[Path, str]:
    """Return the texts of the requested outputs (prediction, model, report) by their paths."""
    from gateway.twin.reconcile.output.serialisation import format_model_toml

    found = {}
    if arguments.prediction is not None:
        found[arguments.prediction] = _prediction(result, predicted, of_second=arguments.held_out is not None)
    if arguments.write_model is not None:
        found[arguments.write_model] = format_model_toml(result)
    if arguments.report is not None:
        found[arguments.report] = _report(arguments, result, runtime_s)
    return found


def _prediction(result: "Reconciliation", source: "Source", *, of_second: bool) -> str:
    """Return the prediction of the held-out recording, or of both parts of the log."""
    from gateway.twin.reconcile.output.result import AVERAGED
    from gateway.twin.reconcile.output.serialisation import format_prediction_csv

    curves: list[Curves | None] = [result.held_out] if of_second else [result.log, result.held_out]
    predicted = [each for each in curves if each is not None]
    row_times_s = source.recording.time_s if AVERAGED in result.counts else None
    return format_prediction_csv(predicted, source.held_rows if predicted else None, row_times_s)


def _report(arguments: argparse.Namespace, result: "Reconciliation", runtime_s: float) -> str:
    from gateway import __version__
    from gateway.twin.report.page import render_report

    computed = {"recording": str(arguments.log)}
    computed["rig"] = "from the recording" if arguments.rig is None else str(arguments.rig)
    computed["held out"] = "the recording’s last third" if arguments.held_out is None else str(arguments.held_out)
    if arguments.effects_from:
        computed["effects of the user"] = ", ".join(map(str, arguments.effects_from))
    computed |= {"seed": str(arguments.seed), "time": f"{runtime_s:.1f} s"}
    return render_report(
        result, title=f"Reconciliation of {arguments.log.name}", software=f"plumbline {__version__}", computed=computed
    )
