"""`plumbline reconcile --plan`: the experiment that separates effects."""

import argparse
from pathlib import Path

from gateway.cli.analysis.effects import load_user_effects


def add_plan_arguments(command: argparse.ArgumentParser) -> None:
    """Add the options of a plan; `--json` is an option of the command itself."""
    command.add_argument(
        "--plan",
        type=Path,
        metavar="RIG",
        help="without LOG: propose the experiment that separates effects on this rig",
    )
    command.add_argument(
        "--effects",
        metavar="A,B,...",
        help="with --plan: the effects to separate, such as steady_wind,axis_offset[x+y]; "
        "without it the ambiguity groups of the rig",
    )


def wants_plan(arguments: argparse.Namespace) -> bool:
    """Return whether a plan is asked for. Raises `InputError` for options that contradict each other."""
    from gateway.errors import InputError

    if arguments.plan is None and arguments.log is None:
        raise InputError("reconcile needs a recording: reconcile LOG --rig RIG; or --plan RIG without one")
    if arguments.plan is not None and arguments.log is not None:
        raise InputError(f"reconcile --plan {arguments.plan} reads no recording; leave {arguments.log} or --plan out")
    if arguments.plan is None and arguments.effects is not None:
        raise InputError("reconcile --effects belongs to --plan RIG; add that, or leave --effects out")
    return arguments.plan is not None


def run_plan(arguments: argparse.Namespace) -> int:
    """Print the plan; the exit code is 1 if no experiment separates anything."""
    from gateway.cli.options.optional_dependencies import require_twin

    require_twin()
    from gateway.cli.terminal.output import show
    from gateway.cli.terminal.progress import Progress
    from gateway.measurement.rig_file import read_rig
    from gateway.twin.experiment_design.hypotheses import parse_hypotheses
    from gateway.twin.experiment_design.plan import plan
    from gateway.twin.experiment_design.text import as_json, as_text
    from gateway.twin.model import model_of

    load_user_effects(arguments)
    model = model_of(read_rig(arguments.plan), str(arguments.plan))
    groups = None if arguments.effects is None else (parse_hypotheses(arguments.effects),)
    with Progress() as progress:
        result = plan(model.rig, groups, progress.tick, model.effects)
    show(as_text(result), as_json(result), arguments.json)
    return 0 if result.improves_separation else 1
