"""The latest messages of many gateways, their ages and states. All methods are called from one thread."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime

from pydantic import ValidationError

from gateway.bus.authenticity import DOUBT_S, Doubt, newer_doubt
from gateway.bus.fleet_inbox import FleetArrival, FleetBatch
from gateway.fleet.gateway_status import GatewayStatus, gateway_status, missing_gateway
from gateway.messages import Health, Message
from gateway.page.verdict import PageEvidence
from gateway.topics import adapter

JUDGED_TOPICS = ("swing", "condition", "alert")
"""The topics on whose freshness a state depends."""
HEARTBEAT = "alert"
"""Sent each second whatever is measured; a message of another topic is new only if it describes a newer sample."""
FLEET_PATIENCE_S = 2.0
"""A topic is stale when its next message is overdue by this time. Basis: twice the default of a gateway's own page."""
DUPLICATE_S = 10.0
"""A boot id that comes back after another one within this time belongs to a second gateway of the same name. Basis: a choice; two
gateways alternate with each message, and no restart returns to an earlier boot."""


@dataclass(slots=True)
class _GatewayMessages:
    """The latest messages of one gateway."""

    alive: bool = False
    latest: dict[str, Message] = field(default_factory=dict)
    live_at_s: dict[str, float] = field(default_factory=dict)
    """Arrival of the last live message with a newer sample, by topic."""
    newest: tuple[int, float] | None = None
    """UTC of the last live message on the gateway's own clock, ns, and its arrival."""
    boots: dict[str, float] = field(default_factory=dict)
    """Arrival of the last live health message, by boot id."""
    boot_id: str | None = None
    duplicate_at_s: float | None = None
    authentic: bool = False
    """Messages that are signed and fresh have come: others are no longer taken."""
    doubt: tuple[Doubt, float] | None = None
    """The last doubt about a message, and when it came."""

    def doubt_text(self, now_s: float) -> str | None:
        """Return why what is known of the gateway is not authenticated, or that somebody forges its messages; None: neither."""
        if self.doubt is None:
            return None
        doubt, at_s = self.doubt
        if not self.authentic:
            return doubt.text if self.latest else None
        is_forged = doubt.kind != "unproved" and now_s - at_s <= DOUBT_S
        return f"messages come under this name that are not its own: {doubt.text}" if is_forged else None

    @property
    def is_settled(self) -> bool:
        """Whether more messages cannot make a doubtful gateway an authentic one."""
        return self.authentic or (self.doubt is not None and self.doubt[0].kind != "unproved")

    def add(self, topic: str, message: Message, arrival: FleetArrival) -> None:
        """Take a message; an older one never replaces a live one, nor a doubtful one an authentic one."""
        if self.authentic and arrival.doubt is not None:
            return
        if arrival.doubt is None and not self.authentic:  # what came before may have been forged
            self.latest, self.live_at_s, self.newest, self.boots = {}, {}, None, {}
            self.authentic, self.boot_id, self.duplicate_at_s = True, None, None
        before = self.latest.get(topic)
        if not arrival.live:
            if topic not in self.live_at_s:
                self.latest[topic] = message
            return
        if topic == HEARTBEAT or before is None or message.time_ns != before.time_ns or topic not in self.live_at_s:
            self.live_at_s[topic] = arrival.at_s
        self.latest[topic] = message
        self.newest = (message.time_ns, arrival.at_s)
        if isinstance(message, Health):
            self._note_boot(message.boot_id, arrival.at_s)

    def _note_boot(self, boot_id: str, at_s: float) -> None:
        returned = boot_id != self.boot_id and at_s - self.boots.get(boot_id, float("-inf")) <= DUPLICATE_S
        if returned:
            self.duplicate_at_s = at_s
        self.boots = {known: seen_s for known, seen_s in self.boots.items() if at_s - seen_s <= DUPLICATE_S}
        self.boots[boot_id] = at_s
        self.boot_id = boot_id

    def age_s(self, topic: str, now_s: float) -> float | None:
        """Return the time since a topic's last new message.

        That of an older message, from a storage, is the distance to the last live message on the gateway's own clock.
        """
        if (at_s := self.live_at_s.get(topic)) is not None:
            return max(now_s - at_s, 0.0)
        if self.newest is None or topic not in self.latest:
            return None
        time_ns, at_s = self.newest
        return max(time_ns - self.latest[topic].time_ns, 0) / 1e9 + max(now_s - at_s, 0.0)

    def evidence(self, now_s: float) -> PageEvidence:
        """Return everything on which the verdict depends; a message of unknown age is no evidence."""
        ages = {topic: age for topic in self.latest if (age := self.age_s(topic, now_s)) is not None}
        known = {
            topic: message for topic, message in self.latest.items() if topic in ages or topic not in JUDGED_TOPICS
        }
        return PageEvidence(self.alive, known, ages, FLEET_PATIENCE_S, JUDGED_TOPICS, self.doubt_text(now_s))

    def is_duplicate(self, now_s: float) -> bool:
        """Return whether two gateways sent under this name lately."""
        return self.duplicate_at_s is not None and now_s - self.duplicate_at_s <= DUPLICATE_S

    def seen_s(self, now_s: float, now_utc: datetime) -> float | None:
        """Return the time since the last message; that of a stored one by its own clock."""
        if self.newest is not None:
            return max(now_s - self.newest[1], 0.0)
        if not self.latest:
            return None
        newest_ns = max(message.time_ns for message in self.latest.values())
        return max(now_utc.timestamp() - newest_ns / 1e9, 0.0)


class FleetState:
    """The gateways that were seen, and those that are expected."""

    def __init__(self, expected: frozenset[str] = frozenset()) -> None:
        self.expected = expected
        self.invalid = 0
        """Number of payloads that are not a valid message of their topic."""
        self._gateways: dict[str, _GatewayMessages] = {}

    def receive(self, batch: FleetBatch) -> None:
        """Take what has come; what is no valid message is counted and dropped."""
        for key, alive in batch.alive.items():
            self._gateways.setdefault(key, _GatewayMessages()).alive = alive
        for key, doubt in batch.doubts.items():
            gateway = self._gateways.setdefault(key, _GatewayMessages())
            gateway.doubt = newer_doubt(gateway.doubt, *doubt)
        for (key, topic), arrival in batch.arrivals.items():
            try:
                message: Message = adapter(topic).validate_json(arrival.payload)
            except ValidationError:
                self.invalid += 1
                continue
            self._gateways.setdefault(key, _GatewayMessages()).add(topic, message, arrival)

    def messages(self, key: str) -> Mapping[str, Message]:
        """Return the latest valid message of each topic of a gateway."""
        return dict(self._gateways[key].latest)

    def statuses(self, now_s: float, now_utc: datetime) -> list[GatewayStatus]:
        """Return the status of every gateway, by key."""
        seen = [
            gateway_status(
                key,
                gateway.evidence(now_s),
                gateway.seen_s(now_s, now_utc),
                now_utc,
                duplicate=gateway.is_duplicate(now_s),
            )
            for key, gateway in self._gateways.items()
        ]
        missing = [missing_gateway(key) for key in self.expected - self._gateways.keys()]
        return sorted([*seen, *missing], key=lambda status: status.key)

    def evidence(self, now_s: float) -> dict[str, PageEvidence]:
        """Return what is known of every gateway, by key."""
        return {key: gateway.evidence(now_s) for key, gateway in sorted(self._gateways.items())}

    @property
    def complete(self) -> bool:
        """Whether every gateway that is alive has sent what its state depends on, and every expected one is alive."""
        alive = {key: gateway for key, gateway in self._gateways.items() if gateway.alive}
        return self.expected <= alive.keys() and all(
            HEARTBEAT in gateway.live_at_s
            and gateway.is_settled
            and {*JUDGED_TOPICS, "health"} <= gateway.latest.keys()
            for gateway in alive.values()
        )
