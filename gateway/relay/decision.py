"""Whether the relay is energised, from the alerts; time is an argument."""

import math
from dataclasses import dataclass

from gateway.configuration.relay_section import RelaySection
from gateway.gateway_state import GatewayState, stated_state
from gateway.messages import CALIBRATION_RULE, ActiveAlert, Alert, Level

DROP_LEVELS: dict[str, tuple[Level, ...]] = {"warn": ("warn", "trip"), "trip": ("trip",)}


@dataclass(frozen=True, slots=True)
class RelayDecision:
    """Whether the relay is energised, and why it is not."""

    energised: bool
    reason: str


class RelayLogic:
    """Judges each alert message. Before the first known level the relay is released."""

    def __init__(self, settings: RelaySection) -> None:
        self._settings = settings
        self._known_s = -math.inf
        """Time of the last alert in which everything was known."""

    def judge(self, alert: Alert, time_s: float) -> RelayDecision:
        """Return whether the relay is energised after this message."""
        if not _is_unknown(alert):
            self._known_s = time_s
        dropping = [active for active in alert.active if self._drops(active)]
        if dropping:
            return RelayDecision(False, "; ".join(active.text for active in dropping))
        if alert.level in DROP_LEVELS[self._settings.drop_at] and not alert.active:
            return RelayDecision(False, alert.text)
        if time_s - self._known_s > self._settings.unknown_s or not math.isfinite(self._known_s):
            return RelayDecision(False, f"not known for more than {self._settings.unknown_s:g} s: {alert.text}")
        return RelayDecision(True, "")

    def _drops(self, active: ActiveAlert) -> bool:
        if active.level not in DROP_LEVELS[self._settings.drop_at]:
            return False
        return not (self._settings.ignore_acknowledged and active.acknowledged_by is not None)


def _is_unknown(alert: Alert) -> bool:
    """Return whether the gateway says so of its levels, or one is unknown or stands without a known value."""
    return (
        stated_state(alert) is not GatewayState.FINE
        or alert.level == "unknown"
        or any(
            active.level == "unknown" or (active.rule != CALIBRATION_RULE and active.value_deg is None)
            for active in alert.active
        )
    )
