"""`plumbline run`: run the gateway."""

import argparse
import logging
import os
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from devices.errors import DeviceError
from gateway.cli.argument_types import above_zero, at_least_zero
from gateway.cli.command import command, option
from gateway.cli.recording_options import add_table_options
from gateway.errors import ANSWER_IS_NO, WITH_LOSSES, PlumblineError

if TYPE_CHECKING:
    from gateway.daemon.commands.configuration_service import ConfigurationService
    from gateway.daemon.gateway import Gateway
    from gateway.daemon.runtime.logs import LineWriter

NO_OTHERS = 0o027
"""Definition: access rights that files of the gateway do not have: those of users outside its group, and writing by the group."""
OUTPUT_S = 0.3
"""Longest wait for a reader of standard output or error to take the last lines. Basis: a choice; a pipe takes them in
milliseconds, and a reader that hangs holds no end up."""


@command(
    "run",
    "run the gateway: sample, evaluate, record, publish, display",
    "Run the gateway until Ctrl-C or SIGTERM. Without --config it runs with a simulated crane.",
    "examples: plumbline run | plumbline run --config adxl355.toml | plumbline run --duration 30 | "
    "plumbline run --replay phone.csv --axes y,-x,z --speed 0",
    option("--config", type=Path, metavar="FILE", help="configuration (TOML); plumbline config show prints one"),
    option("--duration", type=above_zero, metavar="S", help="stop cleanly after this many seconds"),
    option("--replay", type=Path, metavar="LOG", help="play a recording in place of the device: .mcap, or a table"),
    option(
        "--speed", type=at_least_zero, metavar="N", help="of --replay: multiple of real time; 0: as fast as possible"
    ),
    add_table_options,
    option("--quiet", action="store_true", help="print warnings and errors only"),
    option("--service", action="store_true", help="require a sensor: refuse a simulated crane and a recording"),
)
def run_gateway(arguments: argparse.Namespace) -> int:
    """Run the gateway."""
    from gateway.daemon.runtime.logs import LineWriter, start_logging
    from gateway.daemon.runtime.stop_request import StopRequest

    os.umask(NO_OTHERS)
    stopping = StopRequest()
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda *_: stopping.set())
    output = LineWriter(sys.stdout.fileno())
    output.start()
    errors = start_logging(logging.WARNING if arguments.quiet else logging.INFO)
    try:
        return _run(arguments, stopping, output, errors)
    finally:
        for writer in (output, errors):
            writer.finish(OUTPUT_S)


def _run(arguments: argparse.Namespace, stopping: threading.Event, output: "LineWriter", errors: "LineWriter") -> int:
    from gateway.daemon.commands.configuration_service import ConfigurationService
    from gateway.daemon.runtime.instance import InstanceError

    changes = ConfigurationService(arguments.config, service=arguments.service, environment=os.environ)
    changes.resume()
    try:
        gateway = _make_gateway(arguments, errors, changes)
    except InstanceError:
        raise  # another gateway runs: that is no fault of this configuration
    except (PlumblineError, DeviceError) as error:
        if not changes.on_trial:
            raise
        changes.roll_back(str(error))
        return _start_again(output, errors)
    failed = gateway.run(stopping, arguments.duration, str if arguments.quiet else output.put)
    if failed is not None and changes.on_trial:
        changes.roll_back(f"the {failed} thread failed")
    if changes.restart_wanted:
        return _start_again(output, errors)
    code = _exit_code(gateway, failed, errors)
    if gateway.shutdown.stuck:
        rest = (
            "; nothing is lost: the next start compacts the last recording"
            if gateway.shutdown.stuck == ["compaction"]
            else ""
        )
        errors.put(
            f"plumbline run: ended without {', '.join(gateway.shutdown.stuck)}, which did not stop in time{rest}"
        )
    return code


def _exit_code(gateway: "Gateway", failed: str | None, errors: "LineWriter") -> int:
    """Return the exit code, and print what has failed or was lost; `failed`: name of a thread."""
    if failed is not None:
        errors.put(f"plumbline run: the {failed} thread failed; see the log above")
        return ANSWER_IS_NO
    if gateway.samples_not_recorded:
        errors.put(f"plumbline run: {gateway.samples_not_recorded} samples could not be recorded")
        return WITH_LOSSES
    if gateway.is_backlog_lost:
        errors.put("plumbline run: samples that waited in a queue could not be recorded")
        return WITH_LOSSES
    return 0


def _make_gateway(arguments: argparse.Namespace, errors: "LineWriter", changes: "ConfigurationService") -> "Gateway":
    from gateway.configuration.loading import load, require_sensor
    from gateway.daemon.gateway import Gateway

    configuration = load(arguments.config, device=replay_section(arguments))
    if arguments.service:
        require_sensor(configuration, str(arguments.config or "the embedded default"))
    return Gateway(configuration, errors, changes, waits_for_device=arguments.service)


def _start_again(*writers: "LineWriter") -> int:
    """Start this program again, with the same arguments; under systemd, leave that to it."""
    for writer in writers:
        writer.finish(OUTPUT_S)
    if not os.environ.get("NOTIFY_SOCKET"):
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    return 0


def replay_section(arguments: argparse.Namespace) -> dict[str, Any] | None:
    """Return the section `[device]` of the options; None without `--replay`. Raises `InputError` for options without it."""
    from gateway.errors import InputError

    stated = {
        "speed": arguments.speed,
        "axis_columns": None if arguments.columns is None else list(arguments.columns),
        "time_column": arguments.time,
        "unit": arguments.unit,
        "units_per_g": arguments.units_per_g,
        "rate_hz": arguments.rate,
        "axes_map": None
        if arguments.axes is None
        else ",".join(f"{'-' if sign < 0 else ''}{'xyz'[axis]}" for axis, sign in arguments.axes),
    }
    section = {key: value for key, value in stated.items() if value is not None}
    if arguments.replay is not None:
        return {"kind": "replay", "path": str(arguments.replay), **section}
    if section:
        raise InputError(
            "--columns, --unit, --units-per-g, --time, --axes, --rate and --speed describe the recording of --replay LOG"
        )
    return None
