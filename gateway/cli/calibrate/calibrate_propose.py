"""`plumbline calibrate propose`: a gateway offers what its own recordings show better than its record in force."""

import argparse
from pathlib import Path

from gateway.cli.command import command, option


@command(
    "propose",
    "offer the change with temperature that a gateway's own recordings show",
    "Learn the axis along the rope against temperature from the rests of the last week's finished recordings of a gateway, by "
    "the record in force. Where they know it better than the data sheet, a new record is put into the gateway's store as an "
    "offer: `remote status`, `doctor` and the page show it, and nothing uses it until it is put in force. A timer of the service "
    "runs this once a week. Exit code 1: nothing is offered.",
    "example: plumbline calibrate propose --config crane.toml",
    option("--config", type=Path, metavar="FILE", help="configuration of the gateway (default: the installed one)"),
)
def run_propose(arguments: argparse.Namespace) -> int:
    """Store an offer, and print how to put it in force."""
    from datetime import UTC, datetime

    from gateway.cli.calibrate.proposal import propose_thermal
    from gateway.cli.progress import Progress
    from gateway.configuration.loading import load, load_installed

    configuration = load_installed() if arguments.config is None else load(arguments.config)
    now_utc = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    with Progress() as progress:
        record = propose_thermal(configuration.gateway.data_dir, now_utc, lambda share: progress.tick("reading", share))
    print(f"offered: record {record.id}: {record.warnings[0]}")
    print(f"put it in force: plumbline remote rollback --to {record.id} --by NAME --reason TEXT")
    return 0
