"""What the page tells its gateway about signing in: wrong PINs, counted, and what became of the PIN."""

import asyncio
from collections.abc import Callable
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import to_json

REPORT_INTERVAL_S = 1.0
"""Shortest time between two reports, so that a flood of wrong PINs costs the gateway nothing. Basis: a choice; the gateway's
health comes as often."""
PinState = Literal["good", "void", "replaced"]


class SignInReport(BaseModel):
    """One report."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    wrong: Annotated[int, Field(ge=0)]
    """Wrong PINs since the report before."""
    address: Annotated[str, Field(max_length=64)]
    """Where the last one was entered."""
    pin: PinState | None
    """What became of the PIN: somebody has signed in with it; it is void; a new one is in its file. None: nothing new."""


class SignInReporter:
    """Merges what happens within a second into one report; used by the page's one thread."""

    def __init__(self, send: Callable[[bytes], bool]) -> None:
        """`send` returns False where the gateway does not take the report now."""
        self._send = send
        self._wrong, self._address = 0, ""
        self._pin: PinState | None = None
        self._timer: asyncio.TimerHandle | None = None

    def note_wrong(self, address: str) -> None:
        """Note a wrong PIN."""
        self._wrong += 1
        self._address = address
        self._report_soon()

    def note_pin(self, pin: PinState) -> None:
        """Note what became of the PIN."""
        self._pin = pin
        self._report_soon()

    def _report_soon(self) -> None:
        if self._timer is None:
            self._report()

    def _report(self) -> None:
        self._timer = None
        if self._wrong == 0 and self._pin is None:
            return
        report = SignInReport(wrong=self._wrong, address=self._address, pin=self._pin)
        if self._send(to_json(report)):
            self._wrong, self._pin = 0, None
        self._timer = asyncio.get_running_loop().call_later(REPORT_INTERVAL_S, self._report)
