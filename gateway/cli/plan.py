"""`plumbline reconcile --plan`: the manoeuvre that would tell effects apart."""

import argparse
from pathlib import Path

from gateway.cli.effect_files import load_user_effects


def add_plan_arguments(command: argparse.ArgumentParser) -> None:
    """Add what only a plan takes; `--json` is the command's own."""
    command.add_argument(
        "--plan", type=Path, metavar="RIG", help="no LOG: propose the manoeuvre that tells effects apart on this rig"
    )
    command.add_argument(
        "--effects",
        metavar="A,B,...",
        help="with --plan: what to tell apart, such as steady_wind,axis_offset[x+y] (else all known groups)",
    )


def wants_plan(arguments: argparse.Namespace) -> bool:
    """Whether a plan is asked for. Raises `InputError` where that is not clear."""
    from gateway.errors import InputError

    if arguments.plan is None and arguments.log is None:
        raise InputError("reconcile wants a recording: reconcile LOG --rig RIG; or --plan RIG without one")
    if arguments.plan is not None and arguments.log is not None:
        raise InputError(
            f"reconcile --plan {arguments.plan} looks at no recording; leave {arguments.log} or --plan out"
        )
    if arguments.plan is None and arguments.effects is not None:
        raise InputError("reconcile --effects belongs to --plan RIG; add that, or leave --effects out")
    return arguments.plan is not None


def run_plan(arguments: argparse.Namespace) -> int:
    """Plan and tell; exit code 1 where no manoeuvre tells anything apart."""
    from gateway.cli.optional_dependencies import require_twin

    require_twin()
    from gateway.cli.output import write_json
    from gateway.cli.progress import Progress
    from gateway.measurement.rig import read_rig
    from gateway.twin.experiment_design.hypotheses import GROUPS, suspects
    from gateway.twin.experiment_design.plan import plan
    from gateway.twin.experiment_design.text import as_json, as_text
    from gateway.twin.model import model_of

    load_user_effects(arguments)
    model = model_of(read_rig(arguments.plan), str(arguments.plan))
    groups = GROUPS if arguments.effects is None else (suspects(arguments.effects),)
    with Progress() as progress:
        found = plan(model.rig, groups, progress.tick, model.effects)
    if arguments.json is not None:
        write_json(arguments.json, as_json(found))
    print(as_text(found))
    return 0 if found.improves_separation else 1
