"""The check of the relay for `plumbline doctor`, which switches nothing."""

import importlib.util
import os
import shutil
from collections.abc import Iterator

from gateway.configuration.model import Configuration
from gateway.configuration.relay_section import GpioRelay, NoRelay
from gateway.daemon.check_result import CheckResult


def check_relay(configuration: Configuration) -> Iterator[CheckResult]:
    """Check that the configured output can be used."""
    relay = configuration.relay
    if isinstance(relay, NoRelay):
        return
    if isinstance(relay, GpioRelay):
        yield _check_gpio(relay)
    elif shutil.which(relay.command[0]) is None:
        yield CheckResult(
            "bad", "relay", f"{relay.command[0]}: no such program, or not executable; correct relay.command"
        )
    else:
        yield CheckResult("good", "relay", f"{relay.command[0]} can be run; it was not called")


def _check_gpio(relay: GpioRelay) -> CheckResult:
    if importlib.util.find_spec("gpiod") is None:
        return CheckResult("bad", "relay", "gpiod is not installed; install plumbline-gateway[relay]")
    if not relay.chip.exists():
        return CheckResult(
            "bad", "relay", f"{relay.chip}: no such GPIO chip; correct relay.chip (gpiodetect lists them)"
        )
    if not os.access(relay.chip, os.R_OK | os.W_OK):
        return CheckResult(
            "bad", "relay", f"{relay.chip}: no permission; add the user to the group gpio (docs/relay.md)"
        )
    return CheckResult("good", "relay", f"{relay.chip}, line {relay.line}: can be opened; the line was not switched")
