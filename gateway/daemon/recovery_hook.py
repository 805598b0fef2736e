"""Commands of the configuration that recover the bus or the supply of a sensor."""

import logging
import subprocess

log = logging.getLogger("plumbline.device")
LONGEST_S = 5.0
"""Shorter than the period of the watchdog."""


def run_hook(command: list[str]) -> bool:
    """Run a command for at most five seconds; return whether it ended with exit code 0."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        log.error("recovery command %s failed: %s; check the configuration of the device", command[0], error)
        return False
    if done.returncode:
        output = (done.stderr or done.stdout).strip().splitlines()
        log.error("recovery command %s: exit code %d, %s", command[0], done.returncode, output[-1] if output else "-")
        return False
    log.warning("recovery command %s was run", command[0])
    return True
