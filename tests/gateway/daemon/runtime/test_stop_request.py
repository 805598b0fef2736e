"""A signal that comes while the main thread waits for it."""

import subprocess
import sys

import pytest

STORM = """
import signal, time
{event}
signal.signal(signal.SIGALRM, lambda *_: stopping.set())
signal.setitimer(signal.ITIMER_REAL, 0.001, 0.0003)
end_s = time.monotonic() + {lasting_s}
while time.monotonic() < end_s:
    stopping.wait(0.001)
print("stopped" if stopping.is_set() else "not asked")
"""


def stops(event: str, lasting_s: float = 2.0) -> bool:
    """Return whether a program that waits and is signalled 3000 times a second comes to its end."""
    program = STORM.format(event=event, lasting_s=lasting_s)
    try:
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20, check=False)
    except subprocess.TimeoutExpired:
        return False
    return done.stdout == "stopped\n"


@pytest.mark.slow
def test_a_signal_inside_the_wait_for_it_stops_the_program() -> None:
    assert stops("from gateway.daemon.runtime.stop_request import StopRequest; stopping = StopRequest()")
