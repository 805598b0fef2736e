"""What a receiver of alerts passes on to its consumer."""

from collections.abc import Iterator
from dataclasses import dataclass

from gateway.bus.alert_sequence import MissedChanges
from gateway.bus.authenticity import Doubt
from gateway.gateway_state import GatewayState
from gateway.messages import Alert


@dataclass(frozen=True, slots=True)
class AlertEvent:
    """Something that a consumer must know; `gateway` is its key on the bus."""

    gateway: str
    change: Alert | None = None
    """A change of an alert, each once and in order."""
    missed: MissedChanges | None = None
    """Changes that the gateway no longer has."""
    state: GatewayState | None = None
    """What is known of the gateway now, where that has changed."""
    standing: Alert | None = None
    """With a state: the last alert message, with all alerts that are active."""
    doubt: Doubt | None = None
    """Why a change or a state is not authenticated; None: it is, or nothing is known of it."""


def events_of(
    gateway: str, changes: Iterator[Alert | MissedChanges], doubt: Doubt | None = None
) -> Iterator[AlertEvent]:
    """Yield the events of changes, and of those that are lost."""
    for each in changes:
        if isinstance(each, MissedChanges):
            yield AlertEvent(gateway, missed=each, doubt=doubt)
        else:
            yield AlertEvent(gateway, change=each, doubt=doubt)
