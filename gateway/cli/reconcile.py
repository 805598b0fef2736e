"""`plumbline reconcile`: where simulation and measurement part, and what is missing."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.plan import add_plan_arguments, run_plan, wants_plan

if TYPE_CHECKING:
    from gateway.twin.reconcile.result import Curves, Reconciliation

EXAMPLE = """examples:
  plumbline reconcile log.csv --rig rig.toml --held-out second.csv --json result.json --report report.html
  plumbline reconcile recording.mcap --write-model model.toml
  plumbline reconcile --plan rig.toml --effects steady_wind,axis_offset"""


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "reconcile",
        help="where simulation and measurement disagree, and what is missing",
        description="Fit the believed model to a recording, name what it lacks, and judge that on held-out data.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument(
        "log", type=Path, nargs="?", metavar="LOG", help=".mcap of the gateway, or .csv: time_s,ax_g,ay_g,az_g"
    )
    command.add_argument("--rig", type=Path, metavar="RIG", help="rig.toml; a gateway's .mcap brings its own")
    command.add_argument(
        "--held-out", type=Path, metavar="LOG2", help="a second recording to judge on (else LOG's last third)"
    )
    command.add_argument("--json", type=Path, metavar="FILE", help="write the result as JSON")
    command.add_argument("--report", type=Path, metavar="FILE.html", help="write a report for people")
    command.add_argument(
        "--prediction", type=Path, metavar="FILE.csv", help="write the prediction of LOG2 (of LOG without one)"
    )
    command.add_argument(
        "--write-model", type=Path, metavar="FILE.toml", help="write the rig with the model that was found"
    )
    command.add_argument("--seed", type=int, default=0, metavar="N", help="of the block bootstrap (0)")
    add_plan_arguments(command)
    command.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reconcile and tell; exit code 1 where something is missing that has no name, or the data cannot be used."""
    if wants_plan(arguments):
        return run_plan(arguments)
    from gateway.cli.extras import require_twin

    require_twin()
    import time

    from gateway.cli.output import write_json, write_text
    from gateway.cli.progress import Progress
    from gateway.measurement.rig import read_rig
    from gateway.measurement.source import read_source
    from gateway.twin.model import model_of
    from gateway.twin.reconcile.json_form import as_json
    from gateway.twin.reconcile.loading import believed_by, prepared
    from gateway.twin.reconcile.reconcile import reconcile
    from gateway.twin.reconcile.text import as_text

    begin_s = time.monotonic()
    rig = None if arguments.rig is None else read_rig(arguments.rig)
    source = read_source(arguments.log, rig)
    model = believed_by(source) if rig is None else model_of(rig, str(arguments.rig))
    log = prepared(source, model.rig)
    second = None if arguments.held_out is None else prepared(read_source(arguments.held_out, rig), model.rig)
    with Progress() as progress:
        result = reconcile(model, log, second, seed=arguments.seed, tick=progress.tick)
    runtime_s = time.monotonic() - begin_s
    if arguments.json is not None:
        write_json(arguments.json, as_json(result, runtime_s))
    if arguments.prediction is not None:
        write_text(arguments.prediction, _prediction(result, second is not None))
    if arguments.write_model is not None:
        write_text(arguments.write_model, _model(result))
    if arguments.report is not None:
        write_text(arguments.report, _report(arguments, result, runtime_s))
    print(as_text(result))
    return 1 if result.verdict in ("unmodelled", "data_unusable") else 0


def _prediction(result: "Reconciliation", of_second: bool) -> str:
    from gateway.twin.reconcile.writing import prediction_csv

    curves: list[Curves | None] = [result.held_out] if of_second else [result.log, result.held_out]
    return prediction_csv([each for each in curves if each is not None])


def _model(result: "Reconciliation") -> str:
    from gateway.twin.reconcile.writing import model_toml

    return model_toml(result)


def _report(arguments: argparse.Namespace, result: "Reconciliation", runtime_s: float) -> str:
    from gateway import __version__
    from gateway.twin.report.page import report

    computed = {"recording": str(arguments.log), "rig": str(arguments.rig), "held out": str(arguments.held_out)}
    computed |= {"seed": str(arguments.seed), "time": f"{runtime_s:.1f} s"}
    return report(
        result, title=f"Reconciliation of {arguments.log.name}", software=f"plumbline {__version__}", computed=computed
    )
