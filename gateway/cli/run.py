"""`plumbline run`: run the gateway."""

import argparse
import logging
import signal
import sys
import threading
from pathlib import Path
from types import FrameType

from gateway.cli.argument_types import above_zero
from gateway.cli.replay_options import add_replay_options, replay_section

WITH_LOSSES, FAILED = 3, 1


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    command = commands.add_parser(
        "run",
        help="run the gateway: sample, evaluate, record, publish, display",
        description="Run the gateway until Ctrl-C or SIGTERM. Without --config it runs with a simulated crane.",
        epilog="examples: plumbline run | plumbline run --config adxl355.toml | plumbline run --duration 30 | "
        "plumbline run --replay phone.csv --axes y,-x,z --speed 0",
    )
    command.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration (TOML); plumbline config show prints one"
    )
    command.add_argument("--duration", type=above_zero, metavar="S", help="stop cleanly after this many seconds")
    add_replay_options(command)
    command.add_argument("--quiet", action="store_true", help="print warnings and errors only")
    command.add_argument(
        "--service", action="store_true", help="require a sensor: refuse a simulated crane and a recording"
    )
    command.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the gateway."""
    from gateway.configuration.loading import load
    from gateway.configuration.service_configuration import require_sensor
    from gateway.daemon.gateway import Gateway
    from gateway.daemon.logs import start_logging

    start_logging(logging.WARNING if arguments.quiet else logging.INFO)
    stopping = threading.Event()

    def on_signal(_signal: int, _frame: FrameType | None) -> None:
        stopping.set()

    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, on_signal)
    configuration = load(arguments.config, device=replay_section(arguments))
    if arguments.service:
        require_sensor(configuration, str(arguments.config or "the embedded default"))
    gateway = Gateway(configuration)
    if not arguments.quiet:
        print(gateway.describe(), flush=True)
    failed = gateway.run(stopping, arguments.duration)
    if failed is not None:
        print(f"plumbline run: the {failed} thread failed; see the log above", file=sys.stderr)
        return FAILED
    if gateway.samples_not_recorded:
        print(f"plumbline run: {gateway.samples_not_recorded} samples could not be recorded", file=sys.stderr)
        return WITH_LOSSES
    return 0
