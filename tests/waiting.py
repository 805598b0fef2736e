"""Waiting for what another thread or process does."""

import time
from collections.abc import Callable

PATIENCE_S = 120.0
LOOK_S = 0.02


def wait_until(
    condition: Callable[[], object], what: str, patience_s: float = PATIENCE_S, look_s: float = LOOK_S
) -> None:
    """Fail with what was waited for; the time is generous, nothing is asserted of it."""
    end_s = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < end_s, f"waited in vain for {what}"
        time.sleep(look_s)
