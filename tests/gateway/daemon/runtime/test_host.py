"""The state of the host's clock is asked every second, for years: it leaves nothing behind."""

import ctypes
import gc

from devices.host_clock import HostClock
from gateway.daemon.runtime.host import WallClockMonitor


def test_a_look_at_the_clock_leaves_no_library_and_no_class_behind() -> None:
    monitor = WallClockMonitor(HostClock())
    monitor.poll()
    gc.collect()
    before = libraries()
    for _ in range(1000):
        monitor.poll()
    assert libraries() == before  # before the collector has run


def libraries() -> int:
    """The libraries that are loaded; each has a class of its own."""
    return sum(isinstance(each, ctypes.CDLL) for each in gc.get_objects())
