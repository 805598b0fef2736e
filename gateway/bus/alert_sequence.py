"""The changes of alerts of one gateway in order, each once, whatever the link loses, repeats or reorders.

Pure: live messages and pages of `rpc/alerts` go in, changes come out. A change is identified by boot id and number. A gap in the
numbers, or an unknown boot, is filled from the gateway's outbox before anything later is passed on.
"""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict, Field

from gateway.bus.authenticity import Doubt
from gateway.gateway_state import GatewayState
from gateway.messages import Alert
from gateway.outbox import Position

REMEMBERED_BOOTS = 32
"""Boots of a gateway whose messages are told apart. Basis: a choice; messages of an old boot are late by seconds, and the memory
is bounded."""
MOST_EARLY = 256
"""Messages that wait for an earlier one. Basis: a choice; more than come while a question is answered, and a bound of the
memory."""


class SequenceState(BaseModel):
    """What a receiver keeps over its restart."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    boots: list[tuple[str, int]] = Field(max_length=REMEMBERED_BOOTS)
    """The last number of each boot, the newest boot at the end."""
    number: int
    """Of the last change."""
    boot_id: str | None


class AlertPage(BaseModel):
    """The answer to `rpc/alerts`."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    alerts: list[Alert]
    more: bool
    complete: bool
    """False: the gateway does not know the position that was asked for."""


@dataclass(frozen=True, slots=True)
class AlertRequest:
    """A request for the changes behind a position."""

    number: int
    """Of the request: only the answer to the last one counts."""
    position: Position


@dataclass(frozen=True, slots=True)
class MissedChanges:
    """Changes that the gateway no longer has."""

    first: int
    last: int | None
    """None: it is not known how many."""


class AlertSequence:
    """The state of one receiver for one gateway."""

    def __init__(self, since: int | None = None, state: SequenceState | None = None) -> None:
        """`since` is the number behind which changes are wanted at the first contact; None: those from then on."""
        self._since = since
        self._boots: OrderedDict[str, int] = OrderedDict(state.boots if state else [])
        self._last = None if state is None else Position(state.number, state.boot_id)
        self._target: tuple[str, int] | None = None
        """The newest message that was seen while changes are missing; None: none is missing."""
        self._asked: tuple[str, int] | None = None
        self._cursor: Position | None = None
        """Behind this change the gateway is asked."""
        self._request = AlertRequest(0, Position(0))
        self._skip = 0
        """At the first contact: changes up to this number came before."""
        self._unknown: tuple[str, int] | None = None
        """The last message whose number the gateway itself does not know: damaged on its disk, or not from that gateway."""
        self._early: list[Alert] = []
        """Changes that came while earlier ones are missing."""
        self._held: list[Alert] | None = None
        """Changes of a page that is not complete; they count only if the gateway has nothing that was seen before."""

    @property
    def state(self) -> SequenceState | None:
        """What is kept over a restart; None before the first contact."""
        if self._last is None:
            return None
        return SequenceState(boots=list(self._boots.items()), number=self._last.number, boot_id=self._last.boot_id)

    @property
    def is_waiting(self) -> bool:
        """Whether the gateway is to be asked for changes."""
        return self._cursor is not None

    def ask(self) -> AlertRequest | None:
        """Return what to ask the gateway now; None where nothing is missing."""
        if self._cursor is None:
            return None
        self._asked = self._target
        self._request = AlertRequest(self._request.number + 1, self._cursor)
        return self._request

    def take(self, alert: Alert) -> Iterator[Alert]:
        """Take a live message; yield the change in it if it is the next one."""
        if alert.boot_id is None or alert.alert_number is None or alert.clock == "replayed":  # nobody to ask
            if alert.rule is not None:
                yield alert
            return
        boot_id, number, is_change = alert.boot_id, alert.alert_number, alert.rule is not None
        known = self._boots.get(boot_id)
        if (known is not None and number <= known) or (boot_id, number) == self._unknown:
            return
        if self._cursor is not None:
            self._target = boot_id, number
            self._keep_early(alert)
        elif is_change and known is not None and number == known + 1:
            self._note(boot_id, number)
            yield alert
        else:
            self._begin(boot_id, number, is_change=is_change)
            self._keep_early(alert)

    def give_up(self) -> Iterator[Alert | MissedChanges]:
        """Go on without an answer, so that a gateway which answers nothing cannot hold up what it sends."""
        if self._cursor is None or self._target is None:
            return
        self._held = None
        for alert in self._early:
            if alert.boot_id is not None and alert.alert_number is not None:
                yield from self._take_missing(alert, alert.boot_id, alert.alert_number)
        yield from self._settle(*self._target, is_answered=False)

    def take_page(self, request: AlertRequest, page: AlertPage) -> Iterator[Alert | MissedChanges]:
        """Take the answer to a request; yield the changes that were missing, and which are lost."""
        if self._cursor is None or request != self._request or self._asked is None:
            return  # the answer to an earlier request, or a repeated one
        self._request = AlertRequest(request.number + 1, self._cursor)
        if not page.complete and self._held is None:
            self._held = []
        for alert in page.alerts:
            if alert.boot_id is not None and alert.alert_number is not None and alert.rule is not None:
                yield from self._take_missing(alert, alert.boot_id, alert.alert_number)
        if page.more and page.alerts and page.alerts[-1].alert_number is not None:
            self._cursor = Position(page.alerts[-1].alert_number, page.alerts[-1].boot_id)
        else:
            yield from self._finish()

    def _begin(self, boot_id: str, number: int, *, is_change: bool) -> None:
        self._target = boot_id, number
        if self._last is not None:
            self._cursor = self._last
        elif self._since is not None:
            self._cursor = Position(self._since)
        else:
            self._skip = number - is_change
            self._cursor = Position(max(self._skip - 1, 0))

    def _take_missing(self, alert: Alert, boot_id: str, number: int) -> Iterator[Alert | MissedChanges]:
        if self._held is not None:
            if boot_id not in self._boots:
                self._held.append(alert)
                return
            self._held = None  # everything before was seen
        known = self._boots.get(boot_id)
        if known is not None and number <= known:
            return
        if self._last is not None and number > (before := self._last.number if known is None else known) + 1:
            yield MissedChanges(before + 1, number - 1)
        self._note(boot_id, number)
        if self._skip < number:
            yield alert

    def _finish(self) -> Iterator[Alert | MissedChanges]:
        """End a request, or ask again for what was sent meanwhile."""
        assert self._target is not None
        boot_id, number = self._target
        if self._held is not None:
            yield from self._release_held(boot_id)
        if self._target != self._asked:
            self._cursor = self._last or Position(self._baseline)
            return
        yield from self._settle(boot_id, number, is_answered=True)

    def _settle(self, boot_id: str, number: int, *, is_answered: bool) -> Iterator[MissedChanges]:
        """End the wait for a message. A number that the gateway's answer does not confirm is not believed."""
        before = self._baseline if self._last is None else self._last.number
        known = self._boots.get(boot_id, before)
        if known < number:
            yield MissedChanges(known + 1, number)
            self._unknown = boot_id, number
        if boot_id not in self._boots or not is_answered:
            self._boots[boot_id] = min(number, known) if is_answered else max(number, known)
        if self._last is None:
            self._last = Position(self._boots[boot_id])
        self._trim()
        self._cursor = self._target = self._asked = None
        self._skip = 0
        self._early = []

    def _keep_early(self, alert: Alert) -> None:
        """Keep a change for the case that no answer comes."""
        if alert.rule is not None:
            self._early = [*self._early[-MOST_EARLY + 1 :], alert]

    @property
    def _baseline(self) -> int:
        """Number behind which changes are wanted at the first contact."""
        return self._skip if self._since is None else self._since

    def _release_held(self, boot_id: str) -> Iterator[Alert | MissedChanges]:
        """Yield what the gateway has where nothing of it was seen before; at the first contact only what was asked for."""
        held, self._held = self._held or [], None
        if self._last is None and self._since is None:
            held = [alert for alert in held if alert.boot_id == boot_id and (alert.alert_number or 0) > self._skip]
        else:
            yield MissedChanges((self._baseline if self._last is None else self._last.number) + 1, None)
        for alert in held:
            self._note(alert.boot_id or "", alert.alert_number or 0)
            yield alert

    def _note(self, boot_id: str, number: int) -> None:
        self._boots[boot_id] = number
        self._last = Position(number, boot_id)
        self._trim()

    def _trim(self) -> None:
        while len(self._boots) > REMEMBERED_BOOTS:
            self._boots.popitem(last=False)


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
