"""Start and stop of the page process by its parent."""

import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace

from gateway.page.parameters import Parameters, encode

PATIENCE_S = 2.0


def start(parameters: Parameters, listener: socket.socket) -> subprocess.Popen[bytes]:
    """Start the page on a bound socket, which the caller keeps for a later restart.

    The page has its own process group and does not receive the terminal's Ctrl-C: the parent decides when it ends.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "gateway.page"],
        stdin=subprocess.PIPE,
        pass_fds=[listener.fileno()],
        process_group=0,
    )
    assert process.stdin is not None
    with suppress(BrokenPipeError):  # it ended at once and stated why on stderr; the caller sees its exit code
        process.stdin.write(encode(replace(parameters, fd=listener.fileno())))
        process.stdin.flush()
    return process


def stop(process: subprocess.Popen[bytes]) -> int:
    """End the page, or clean up after one that has ended, and return its exit code. It is killed if it does not end in time."""
    process.terminate()
    if process.stdin is not None:
        with suppress(BrokenPipeError):
            process.stdin.close()
    try:
        return process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()
