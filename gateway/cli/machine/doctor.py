"""`plumbline doctor`: what is wrong on this machine, and how to correct it."""

import argparse
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.command import command, option
from gateway.cli.output import Style, output_file, paint

if TYPE_CHECKING:
    from gateway.configuration.model import Configuration
    from gateway.daemon.doctor import CheckResult

MARK_STYLES: dict[str, Style] = {"good": "good", "note": "note", "bad": "bad"}
MARKS = {"good": "ok  ", "note": "note", "bad": "BAD "}


@command(
    "doctor",
    "find what is wrong on this machine, and how to correct it",
    "Check everything that `plumbline run` needs, or ask the gateway that runs how it does. "
    "Exit code 0: all well; 1: something must be corrected.",
    "examples: plumbline doctor --config adxl355.toml | plumbline doctor --device --config adxl355.toml "
    "| plumbline doctor --bundle crane-1.tar.gz",
    option(
        "--config", type=Path, metavar="FILE", help="configuration (default: the installed one, or a simulated crane)"
    ),
    option(
        "--device",
        action="store_true",
        help="examine the sensor alone: the parts on its bus, its self-test, its readings; it must rest, and no "
        "gateway may run",
    ),
    option(
        "--security",
        action="store_true",
        help="state what is open and to whom: listeners, rights, certificates, files, page",
    ),
    option("--json", type=output_file, metavar="FILE|-", help="write the results as JSON, with what was measured"),
    option(
        "--bundle",
        type=output_file,
        metavar="FILE.tar.gz",
        help="write findings, configuration, versions, state, log and a list of the recordings, without secrets",
    ),
)
def run_doctor(arguments: argparse.Namespace) -> int:
    """Print the result of each check; return 1 if one failed."""
    from gateway.cli.output import STANDARD_OUTPUT, show
    from gateway.configuration.loading import SETTINGS, is_installed, load, load_installed
    from gateway.daemon.doctor import CheckResult
    from gateway.daemon.doctor.checks import examine, examine_sensor_as_user
    from gateway.daemon.doctor.security_check import examine_security

    installed = is_installed() and arguments.config in (None, SETTINGS)
    configuration = _without_hooks(load_installed() if installed else load(arguments.config))
    settings = str(SETTINGS if installed else arguments.config or "embedded default: a simulated crane")
    results = [CheckResult("good", "settings", settings)]
    quiet = arguments.json == STANDARD_OUTPUT
    if not quiet:
        print_result(results[0])
    checks = examine_security if arguments.security else examine_sensor_as_user if arguments.device else examine
    for result in checks(configuration):
        if not quiet:
            print_result(result)
        results.append(result)
    show(_summary(results), _record(results), arguments.json)
    if arguments.bundle is not None:
        from gateway.cli.output import write_bytes
        from gateway.daemon.doctor.diagnostic_bundle import make_bundle

        write_bytes(arguments.bundle, make_bundle(configuration, results))
        print(f"{arguments.bundle}: written, without passwords, keys, tokens and recordings", file=sys.stderr)
    return 1 if any(result.grade == "bad" for result in results) else 0


def _without_hooks(configuration: "Configuration") -> "Configuration":
    """Return the configuration without the commands that revive a sensor: an examination, perhaps by root, runs none."""
    hooks: dict[str, list[str]] = {"bus_clear_command": [], "power_cycle_command": []}
    device = configuration.device
    hooks = {name: value for name, value in hooks.items() if name in type(device).model_fields}
    return configuration.model_copy(update={"device": device.model_copy(update=hooks)})


def print_result(result: "CheckResult") -> None:
    """Print one result at once."""
    print(f"{paint(MARKS[result.grade], MARK_STYLES[result.grade])} {result.place:<12} {result.text}", flush=True)
    for line in result.sketch:
        print(f"{'':<18}{line}", flush=True)


def _summary(results: "list[CheckResult]") -> str:
    """Return the result of all checks in one line."""
    bad = sum(result.grade == "bad" for result in results)
    if bad:
        return f"{bad} to correct, marked {MARKS['bad'].strip()}"
    gateway = next((result for result in results if result.place == "gateway"), None)
    if gateway is None:
        return "all well"
    if any(result.values.get("suspended") for result in results):
        return "running, and alerts are suspended"
    return "running, all well" if gateway.values.get("runs", True) else "all well for a start: no gateway runs"


def _record(results: "list[CheckResult]") -> dict[str, Any]:
    """Return the results with the software and the time."""
    from gateway import __version__

    now_utc = datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    return {"software": __version__, "created_utc": now_utc, "checks": [asdict(result) for result in results]}
