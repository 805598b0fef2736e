"""What the receiver of alerts has heard of one gateway, and what of it is authenticated."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import TypeAdapter, ValidationError

from gateway.bus.alert_sequence import AlertRequest, AlertSequence, SequenceState
from gateway.bus.authenticity import DOUBT_S, Doubt, newer_doubt
from gateway.errors import InputError
from gateway.gateway_state import GatewayPresence, GatewayState

DOUBTED = GatewayState.FINE, GatewayState.NOT_KNOWN, GatewayState.GATEWAY_GONE
"""States that are not stated where somebody else may have sent."""
Heard = Literal["alert", "health"]
"""The topics that are heard: the health is a sign of life where the sensor is silent, and with it the alerts."""
_STATES = TypeAdapter(dict[str, SequenceState])


@dataclass(slots=True)
class HeardGateway:
    """One gateway with the order of its changes."""

    sequence: AlertSequence
    presence: GatewayPresence
    state: GatewayState | None = None
    asked_s: float = float("-inf")
    waiting_since_s: float | None = None
    """Since when earlier changes are missing, and the gateway is heard."""
    is_remembered: bool = False
    """Its last number was kept over a restart."""
    is_authentic: bool = False
    """Messages that are signed and fresh have come: what is not signed is no longer taken."""
    doubt: tuple[Doubt, float] | None = None
    """The last doubt, and when it came."""

    def admit(self, doubt: Doubt | None) -> bool:
        """Note whether something is authenticated; return whether it is taken: marked where no key is known."""
        if doubt is None:
            self.is_authentic = True
            self.doubt = None if self.doubt is not None and self.doubt[0].kind == "unproved" else self.doubt
            return True
        is_signed = doubt.kind == "unproved"
        if not (is_signed and self.is_authentic):
            self.doubt = newer_doubt(self.doubt, doubt, time.monotonic())
        return is_signed or not (self.is_authentic or doubt.kind == "wrong")

    def judge(self, now_s: float, patience_s: float, *, is_linked: bool) -> tuple[GatewayState, Doubt | None]:
        """Return the present state, and why what comes is not authenticated; None: it is, or nothing comes."""
        state = self.presence.judge(now_s, patience_s, is_linked=is_linked)
        doubt = self.doubt[0] if self.doubt is not None and now_s - self.doubt[1] <= DOUBT_S else None
        if doubt is not None and state in DOUBTED and self.presence.is_alive is not False:
            state = GatewayState.NOT_AUTHENTICATED
        return state, doubt


@dataclass(frozen=True, slots=True)
class AlertArrival:
    """Something that has come, in the order of its coming."""

    key: str
    payload: bytes | None = None
    """Of a message, or of the answer to a request."""
    request: AlertRequest | None = None
    attachment: bytes | None = None
    at_s: float = 0.0
    doubt: Doubt | None = None
    """Of an answer."""
    is_alive: bool | None = None
    topic: Heard = "alert"


def write_states(gateways: Mapping[str, HeardGateway]) -> str:
    """Return the last numbers of gateways as a text."""
    states = {key: each.sequence.state for key, each in gateways.items()}
    return _STATES.dump_json({key: state for key, state in states.items() if state is not None}).decode()


def read_states(path: Path | None, states: str) -> dict[str, SequenceState]:
    """Return the last numbers that a file or a text holds. Raises `InputError`."""
    try:
        if path is not None and path.exists():
            return _STATES.validate_json(path.read_bytes())
        return _STATES.validate_json(states)
    except (OSError, ValidationError) as error:
        where = "states" if path is None else str(path)
        raise InputError(
            f"{where}: is no position among the alerts; delete it to begin with the next change"
        ) from error
