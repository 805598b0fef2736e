"""What is known of a gateway, from link, liveliness, any sign of life and the last alert message: pure; time is an argument."""

from dataclasses import dataclass
from enum import StrEnum

from gateway.messages import Alert, Message, Validity

HEARTBEAT_S = 1.0
"""Longest usual interval between two messages of the alerts, and of the gateway's health. Definition: the period at which both
are sent."""


class GatewayState(StrEnum):
    """Only `FINE` means that the level of the alerts is known now."""

    FINE = "fine"
    NOT_KNOWN = "not known"
    """The gateway does not know the angle at the moment, or nothing has come yet."""
    UNCALIBRATED = "uncalibrated"
    NOT_AUTHENTICATED = "not authenticated"
    """What comes under its name is not signed with its key, or somebody else sends under it, too."""
    SUSPENDED = "suspended"
    """The housing is off the rope, for a recalibration."""
    SENSOR_GONE = "sensor gone"
    GATEWAY_GONE = "gateway gone"
    LINK_GONE = "link gone"
    """Nobody is connected; the gateway may work or not."""


BY_VALIDITY: dict[Validity, GatewayState] = {
    "valid": GatewayState.FINE,
    "no_samples": GatewayState.SENSOR_GONE,
    "suspended": GatewayState.SUSPENDED,
    "uncalibrated": GatewayState.UNCALIBRATED,
    "not_known": GatewayState.NOT_KNOWN,
}


@dataclass(slots=True)
class GatewayPresence:
    """What has come from a gateway."""

    is_alive: bool | None = None
    """By its liveliness token; None: nothing is known of it."""
    alert: Alert | None = None
    """The last alert message."""
    alert_s: float = float("-inf")
    """Time of its arrival."""
    heard_s: float = float("-inf")
    """Time at which any message of it arrived last: one whose sensor is silent sends its health."""
    connected_s: float = float("-inf")
    """Time at which the link was there first, or again."""

    @property
    def was_there(self) -> bool:
        """Whether anything was ever known of it."""
        return self.is_alive is not None or self.heard_s > float("-inf")

    def hear(self, message: Message, now_s: float) -> None:
        """Take a message that counts as the gateway's own."""
        self.heard_s = now_s
        if isinstance(message, Alert):
            self.alert, self.alert_s = message, now_s

    def forget(self) -> None:
        """Forget what came: it may have been forged."""
        self.alert = None
        self.alert_s = self.heard_s = float("-inf")

    def judge(self, now_s: float, patience_s: float, *, is_linked: bool) -> GatewayState:
        """Return the present state; `is_linked`: somebody is connected, the gateway or a router."""
        if not is_linked:
            return GatewayState.LINK_GONE
        if self.is_alive is False or is_overdue(now_s - max(self.heard_s, self.connected_s), patience_s):
            return GatewayState.GATEWAY_GONE
        if self.alert is None or is_overdue(now_s - self.alert_s, patience_s):
            return GatewayState.NOT_KNOWN
        return stated_state(self.alert)


def is_overdue(age_s: float, patience_s: float, interval_s: float = HEARTBEAT_S) -> bool:
    """Return whether the message after one of this age is overdue by more than the patience of who waits for it."""
    return age_s > interval_s + patience_s


def stated_state(alert: Alert) -> GatewayState:
    """Return the state that a gateway gives itself in an alert message."""
    return GatewayState.NOT_KNOWN if alert.validity is None else BY_VALIDITY[alert.validity]
