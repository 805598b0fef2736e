"""The changes of alerts on their way to a broker: one at a time, noted on the disk when the broker has taken it. No clock."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from gateway.bridge.mqtt.mqtt_messages import encode_alert
from gateway.bus.alert_receiver import AlertReceiver

MOST_WAITING = 256
"""Changes that wait for the broker. Basis: a choice; an hour of a busy crane. Then the gateway keeps the others, and they are
fetched later."""


@dataclass(frozen=True, slots=True)
class WaitingAlert:
    """A change, and the position of the receiver behind it."""

    payload: bytes
    position: str


class AlertDelivery:
    """Takes changes while there is room, and gives out the oldest until it is taken."""

    def __init__(self, receiver: AlertReceiver) -> None:
        self._receiver = receiver
        self._waiting: deque[WaitingAlert] = deque()

    def receive(self, timeout_s: float) -> None:
        """Wait for changes, a time at most. What does not fit any more is not asked for."""
        if len(self._waiting) < MOST_WAITING:
            self._waiting.extend(self._changes(timeout_s))

    def _changes(self, timeout_s: float) -> Iterator[WaitingAlert]:
        for event in self._receiver.poll(timeout_s):
            if event.state is None:
                yield WaitingAlert(encode_alert(event), self._receiver.states_json)

    @property
    def oldest(self) -> WaitingAlert | None:
        """The change that comes next."""
        return self._waiting[0] if self._waiting else None

    def taken(self) -> str:
        """Note that the broker has the oldest change; return the position from which to go on after a restart."""
        return self._waiting.popleft().position
