"""`plumbline reconcile`: where simulation and measurement disagree, and which effects are missing.

No output file takes the place of another, and all are made before one is written. With `--plan`: the experiment that separates
effects.
"""

import argparse
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import duration_s, whole_number
from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION, STANDARD_OUTPUT, output_file
from gateway.cli.recording_options import add_interval, add_table_options, interval, table_options
from gateway.cli.simulate import EFFECTS_FROM_OPTION, load_user_effects
from gateway.errors import InputError

if TYPE_CHECKING:
    from gateway.measurement.source import Source
    from gateway.twin.model import TwinRig
    from gateway.twin.reconcile.data.crane_inputs import CraneInputs
    from gateway.twin.reconcile.data.data_checks import CheckedRecording
    from gateway.twin.reconcile.output.result import Reconciliation

EXAMPLE = """examples:
  plumbline reconcile log.csv --rig rig.toml --held-out second.csv --json result.json --report report.html
  plumbline reconcile recording.mcap --write-model model.toml
  plumbline reconcile work.csv --rig rig.toml --inputs estimated
  plumbline reconcile log.csv --rig rig.toml --effects-from my_effects.py
  plumbline reconcile --plan rig.toml --effects steady_wind,axis_offset"""


def wants_plan(arguments: argparse.Namespace) -> bool:
    """Return whether a plan is asked for. Raises `InputError` for options that contradict each other."""
    from gateway.errors import InputError

    if arguments.plan is None and not arguments.logs:
        raise InputError("reconcile needs a recording: reconcile LOG --rig RIG; or --plan RIG without one")
    if arguments.plan is not None and arguments.logs:
        raise InputError(
            f"reconcile --plan {arguments.plan} reads no recording; leave {arguments.logs[0]} or --plan out"
        )
    if arguments.plan is None and arguments.effects is not None:
        raise InputError("reconcile --effects belongs to --plan RIG; add that, or leave --effects out")
    return arguments.plan is not None


def run_plan(arguments: argparse.Namespace) -> int:
    """Print the plan; the exit code is 1 if no experiment separates anything."""
    from gateway.extras import require_extra

    require_extra("twin")
    from gateway.cli.output import show
    from gateway.cli.progress import Progress
    from gateway.measurement.rig_file import read_rig
    from gateway.twin.experiment_design.plan import as_json, as_text, plan
    from gateway.twin.experiment_design.signatures import parse_hypotheses
    from gateway.twin.model import model_of

    load_user_effects(arguments)
    model = model_of(read_rig(arguments.plan), str(arguments.plan))
    groups = None if arguments.effects is None else (parse_hypotheses(arguments.effects),)
    with Progress() as progress:
        result = plan(model.rig, groups, progress.tick, model.effects)
    show(as_text(result), as_json(result), arguments.json)
    return 0 if result.improves_separation else 1


@command(
    "reconcile",
    "find where simulation and measurement disagree, and which effects are missing",
    "Fit the nominal model to a recording, name the effects that it lacks, and test them on held-out data.",
    EXAMPLE,
    option(
        "logs",
        type=Path,
        nargs="*",
        metavar="LOG",
        help=".mcap files of one gateway, a folder of them, or one table: time_s,ax_g,ay_g,az_g, or of another program",
    ),
    add_interval,
    option("--rig", type=Path, metavar="RIG", help="rig.toml; an .mcap of the gateway contains its own"),
    option(
        "--held-out",
        type=Path,
        metavar="LOG2",
        help="a second recording to test the model on; without it the end of LOG",
    ),
    JSON_OPTION,
    option("--report", type=output_file, metavar="FILE.html", help="write a report with figures"),
    option(
        "--prediction", type=output_file, metavar="FILE.csv", help="write the prediction of LOG2 (of LOG without one)"
    ),
    option(
        "--write-model", type=output_file, metavar="FILE.toml", help="write the rig with the effects that were found"
    ),
    option(
        "--inputs",
        choices=("auto", "estimated", "none"),
        default="auto",
        help="drives and hoists of the crane: estimated from the recordings and known to the model; none: they are "
        "effects to be "
        "found; auto (the default): estimated for an .mcap, none for a .csv",
    ),
    option(
        "--jobs",
        type=whole_number,
        metavar="N",
        help="processes that share the fits (all cores, at most 4); the answer does not depend on it",
    ),
    option(
        "--at-most",
        dest="at_most_s",
        type=duration_s,
        default=600.0,
        metavar="D",
        help="search no longer than this (10:00), then give the best answer so far: seconds (90), minutes (1:30) or hours "
        "(1:00:00); Ctrl-C asks for it at once, a second one stops without an answer",
    ),
    option("--seed", type=whole_number, default=0, metavar="N", help="seed of the block bootstrap (0)"),
    EFFECTS_FROM_OPTION,
    option(
        "--plan",
        type=Path,
        metavar="RIG",
        help="without LOG: propose the experiment that separates effects on this rig",
    ),
    option(
        "--effects",
        metavar="A,B,...",
        help="with --plan: the effects to separate, such as steady_wind,axis_offset[x+y]; "
        "without it the ambiguity groups of the rig",
    ),
    partial(add_table_options, planar=True),
)
def run_reconcile(arguments: argparse.Namespace) -> int:
    """Print the answer; the exit code is 1 if something unknown is missing, or the data cannot be used."""
    if wants_plan(arguments):
        return run_plan(arguments)
    from gateway.extras import require_extra

    require_extra("twin")
    import time

    from gateway.cli.output import show, write_text
    from gateway.cli.progress import Progress
    from gateway.measurement.rig_file import read_rig_of_recording
    from gateway.measurement.source import read_source
    from gateway.measurement.swing import cut_to_free_swing
    from gateway.twin.model import model_of
    from gateway.twin.reconcile.data.data_checks import check_recording, model_from_recording
    from gateway.twin.reconcile.data.sensor import with_measured_noise
    from gateway.twin.reconcile.output.serialisation import to_json, to_text
    from gateway.twin.reconcile.reconcile import reconcile
    from gateway.twin.reconcile.search.context import usable_processes

    begin_s = time.monotonic()
    _check_files(arguments)
    load_user_effects(arguments)
    part, options = interval(arguments), table_options(arguments)
    found = None if arguments.rig is None else read_rig_of_recording(arguments.rig, arguments.logs, part, options)
    cut = cut_to_free_swing(read_source(arguments.logs, None if found is None else found.rig, part, options))
    source, found = cut.source, None if found is None else found.refined_by(cut.source)
    rig = None if found is None else found.rig
    remarks = [*(() if found is None else found.remarks), *(() if cut.free_swing is None else source.remarks[-1:])]
    model = model_from_recording(source) if rig is None else model_of(rig, str(arguments.rig))
    model, noise_remark = with_measured_noise(model, source)
    remarks += [] if noise_remark is None else [noise_remark]
    log = check_recording(source, model.rig)
    second_source = None
    if arguments.held_out is not None:
        second_source = cut_to_free_swing(read_source([arguments.held_out], rig, options=options)).source
    second = None if second_source is None else check_recording(second_source, model.rig)
    try:
        with Progress(best_so_far=True) as progress:
            progress.tick("inputs of the crane")
            result = reconcile(
                model,
                log,
                second,
                inputs=_inputs(arguments.inputs, source, log, model.rig),
                held_out_inputs=_inputs(arguments.inputs, second_source, second, model.rig, "held_out_"),
                seed=arguments.seed,
                processes=usable_processes() if arguments.jobs is None else max(1, arguments.jobs),
                tick=progress.tick,
                is_over=lambda: progress.is_interrupted or time.monotonic() - begin_s > arguments.at_most_s,
            )
            runtime_s = time.monotonic() - begin_s
            progress.tick("report")
            texts = output_texts(arguments, result, runtime_s, second_source or source)
    except KeyboardInterrupt:
        print("plumbline reconcile: stopped; nothing was written", file=sys.stderr)
        raise
    for path, text in texts.items():
        write_text(path, text)
    text = "\n".join([*(f"remark: {remark}" for remark in remarks), to_text(result)])
    show(text, to_json(result, runtime_s) | {"remarks": remarks}, arguments.json)
    return 1 if result.verdict in ("unmodelled", "data_unusable") else 0


def _inputs(
    choice: str, source: "Source | None", checked: "CheckedRecording | None", rig: "TwinRig", prefix: str = ""
) -> "CraneInputs":
    """Return what the crane did in a recording; nothing where that is not asked for, or the recording cannot be used."""
    from gateway.twin.reconcile.data.crane_inputs import NO_INPUTS, estimate_inputs

    if source is None or checked is None or checked.observations is None:
        return NO_INPUTS
    is_wanted = choice == "estimated" or (choice == "auto" and source.files[0].suffix == ".mcap")
    return estimate_inputs(source, rig, prefix) if is_wanted else NO_INPUTS


def _check_files(arguments: argparse.Namespace) -> None:
    from gateway.errors import InputError

    if arguments.held_out is not None and arguments.held_out.resolve() in [log.resolve() for log in arguments.logs]:
        raise InputError(
            f"--held-out {arguments.held_out}: is LOG itself; leave it out, then the end of LOG is held out"
        )
    check_outputs(
        {
            "--json": arguments.json,
            "--report": arguments.report,
            "--prediction": arguments.prediction,
            "--write-model": arguments.write_model,
        },
        {
            "LOG": arguments.logs[0],
            **{f"LOG {path}": path for path in arguments.logs[1:]},
            "--rig": arguments.rig,
            "--held-out": arguments.held_out,
            **{f"--effects-from {path}": path for path in arguments.effects_from},
        },
    )


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

    if result.comparison is None:
        return format_prediction_csv([])
    log, held_out = result.comparison.log, result.comparison.held_out
    row_times_s = source.recording.time_s if AVERAGED in result.counts else None
    return format_prediction_csv([held_out] if of_second else [log, held_out], source.held_rows, row_times_s)


def _report(arguments: argparse.Namespace, result: "Reconciliation", runtime_s: float) -> str:
    from gateway import __version__
    from gateway.twin.report.page import render_report

    computed = {"recording": ", ".join(map(str, arguments.logs))}
    computed["rig"] = "from the recording" if arguments.rig is None else str(arguments.rig)
    computed["held out"] = "the recording’s last third" if arguments.held_out is None else str(arguments.held_out)
    if arguments.effects_from:
        computed["effects of the user"] = ", ".join(map(str, arguments.effects_from))
    computed |= {"seed": str(arguments.seed), "time": f"{runtime_s:.1f} s"}
    return render_report(
        result,
        title=f"Reconciliation of {arguments.logs[0].name}",
        software=f"plumbline {__version__}",
        computed=computed,
    )
