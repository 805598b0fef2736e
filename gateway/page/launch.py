"""Start and stop of the page process by its parent."""

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace

from gateway.page.channel import PARAMETERS, Frame
from gateway.page.parameters import Parameters, encode

MAX_START_S = 2.0
"""Longest wait for the start. Basis: a choice; an interpreter starts in less on a small board that is idle."""


def start(
    parameters: Parameters, listener: socket.socket, open_channel: Callable[[Frame], socket.socket]
) -> subprocess.Popen[bytes]:
    """Start the page on a bound socket, which the caller keeps for a later restart.

    `open_channel` takes the first frame and returns the page's end of the channel. The page has its own process group and does
    not receive the terminal's Ctrl-C: the parent decides when it ends.
    """
    line = encode(replace(parameters, fd=listener.fileno()))
    with open_channel(Frame(PARAMETERS, time.monotonic(), line)) as channel:
        return subprocess.Popen(
            [sys.executable, "-m", "gateway.page"],
            stdin=channel.fileno(),
            pass_fds=[listener.fileno()],
            process_group=0,
        )


def stop(process: subprocess.Popen[bytes]) -> int:
    """End the page, or clean up after one that has ended, and return its exit code. It is killed if it does not end in time."""
    process.terminate()
    try:
        return process.wait(MAX_START_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()
