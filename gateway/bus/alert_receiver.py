"""The receiver of alerts for other programs: every change once and in order, and at any time what is known of the gateways.

The example in docs/guides/integrator/alerts.md shows its use. All work is done in the thread that calls `poll`; Zenoh's threads
only fill a queue.
"""

import json
import queue
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

import zenoh
from pydantic import ValidationError

from gateway.atomic_io import write_durably
from gateway.authorization.message_signature import Question
from gateway.bus.alert_sequence import AlertEvent, AlertPage, AlertRequest, AlertSequence, SequenceState, events_of
from gateway.bus.authenticity import UNANSWERED, Authenticity, Doubt
from gateway.bus.client import open_client_session
from gateway.bus.credentials import Credentials, load_credentials
from gateway.bus.fleet_inbox import LARGEST_STATE_BYTES
from gateway.bus.heard_gateway import AlertArrival, Heard, HeardGateway, read_states, write_states
from gateway.bus.session import UnreachableError
from gateway.bus.untrusted import GATEWAY_KEY, make_question, read_attachment, send_question
from gateway.gateway_state import GatewayPresence, GatewayState, is_overdue
from gateway.messages import Alert, Health
from gateway.topics import ALIVE, ANY_GATEWAY, adapter

HEARD: tuple[Heard, ...] = ("alert", "health")
INBOX = 4096
"""Messages that may wait. Basis: a choice; sixteen for each of the gateways, and a bound of the memory."""
MOST_FOLLOWED = 256
"""Bound of the memory that a peer with invented names can take. Basis: a choice; more than a site has cranes."""
PATIENCE_S = 0.6
"""A gateway whose next sign of life is overdue by this time is silent. Basis: a choice; a lost packet is repeated within less,
and with the heartbeat of a second silence shows in less than two."""
STEP_S = 0.1
"""Longest wait before the states are judged again. Basis: a choice; a tenth of the heartbeat."""
ANSWER_S = 2.0
"""A request for missed changes without an answer is repeated after this time. Basis: a choice; an answer takes milliseconds on a
site, and a second lost question costs little."""
GIVE_UP_S = 10.0
"""A gateway that sends and does not answer holds up its alerts no longer than this. Basis: a choice; some repetitions of
`ANSWER_S`."""
CONNECT_MS = 1000
"""Longest attempt to connect. Basis: a choice; a router answers in milliseconds, and the next attempt follows."""
HOLD_S = 1.0
"""An alert of a gateway that has not answered yet waits for its answer. Basis: a choice; it comes within milliseconds, and an
alert of a gateway that cannot answer must not wait long."""


class AlertReceiver:
    """Receives the alerts of the gateways that match a pattern. The link may be down at any time, also at the start."""

    def __init__(
        self,
        connect: str,
        pattern: str = ANY_GATEWAY,
        *,
        since: int | None = None,
        state_file: Path | None = None,
        states: str = "{}",
        credentials: Credentials | None = None,
        session: Callable[[], zenoh.Session] | None = None,
    ) -> None:
        """Connect to a gateway or router.

        `since` is the number behind which changes are wanted from a gateway that is met for the first time (0: all that it
        has; None: those from now on). `state_file` keeps the last numbers over a restart; a consumer that stores `states_json`
        together with what it does gives them back as `states`. `credentials` are for links with TLS, and tell the keys of
        gateways. `session` returns the caller's own one, which he closes himself, and raises `UnreachableError` where it is not
        open yet. Raises `InputError` for a file that cannot be read, `BusError` for an endpoint of wrong form.
        """
        self._pattern, self._since, self._state_file = pattern, since, state_file
        self._arrivals: queue.Queue[AlertArrival] = queue.Queue(INBOX)
        self._gateways: dict[str, HeardGateway] = {}
        credentials = credentials or load_credentials()
        self._authenticity = Authenticity(credentials.signers)
        self._find_session = session or partial(open_client_session, connect, credentials, CONNECT_MS)
        self._is_own_session = session is None
        self._held: list[AlertArrival] = []
        """Alerts of gateways that have not answered yet."""
        self._session: zenoh.Session | None = None
        self._linked = False
        self.refused = 0
        """Messages that are neither alert nor health of a gateway: too large, damaged, forged, or under a key not asked for."""
        self.dropped = 0
        """Messages that came faster than they were read; missed changes are fetched."""
        for key, state in read_states(state_file, states).items():
            self._add(key, state)
        self._saved = self.states_json
        self._open()

    @property
    def states_json(self) -> str:
        """The last numbers of all gateways, to be stored with what was done with the changes."""
        return write_states(self._gateways)

    @property
    def present_states(self) -> dict[str, GatewayState]:
        """What is known of each gateway, by key."""
        return {key: each.state or GatewayState.NOT_KNOWN for key, each in self._gateways.items()}

    def __iter__(self) -> Iterator[AlertEvent]:
        """Yield events without end; the position is saved after each group of events was handled."""
        while True:
            yield from self.poll(1.0)

    def poll(self, timeout_s: float) -> Iterator[AlertEvent]:
        """Yield what comes within a time. The state file is written when the events were taken."""
        end_s = time.monotonic() + timeout_s
        while True:
            self._open()
            yield from self._take_arrivals(min(STEP_S, max(0.0, end_s - time.monotonic())))
            self._ask()
            yield from self._give_up()
            yield from self._judge()
            self.save()
            if time.monotonic() >= end_s:
                return

    def save(self) -> None:
        """Write the state file, where there is one and something has changed. Raises `OSError`."""
        if self._state_file is not None and (states := self.states_json) != self._saved:
            write_durably(self._state_file, states.encode())
            self._saved = states

    def close(self) -> None:
        """Close the link, where it is its own."""
        if self._session is not None and self._is_own_session:
            with suppress(zenoh.ZError):
                self._session.close()
        self._session = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:  # else the last event may not have been handled
            self.save()
        self.close()

    def _open(self) -> None:
        """Open the session where there is none; it restores a lost link by itself."""
        if self._session is not None:
            return
        try:
            session = self._find_session()
        except UnreachableError:
            return
        self._subscribers = [
            session.declare_subscriber(f"{self._pattern}/{topic}", partial(self._receive, topic)) for topic in HEARD
        ]
        self._liveliness = session.liveliness().declare_subscriber(
            f"{self._pattern}/{ALIVE}", self._receive_alive, history=True
        )
        self._session = session

    def _receive(self, topic: Heard, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr).removesuffix(f"/{topic}")
        if len(sample.payload) > LARGEST_STATE_BYTES:
            self.refused += 1
        else:
            payload, attachment = sample.payload.to_bytes(), read_attachment(sample)
            self._put(AlertArrival(key, payload, topic=topic, attachment=attachment, at_s=time.monotonic()))

    def _receive_alive(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr).removesuffix(f"/{ALIVE}")
        is_alive = sample.kind == zenoh.SampleKind.PUT
        if is_alive:
            self._authenticity.expect(key)
        self._put(AlertArrival(key, is_alive=is_alive))

    def _receive_page(
        self, key: str, request: AlertRequest, question: Question, sent_s: float, reply: zenoh.Reply
    ) -> None:
        if reply.ok is not None and len(reply.ok.payload) <= LARGEST_STATE_BYTES:
            doubt = self._authenticity.judge_reply(f"{key}/rpc/alerts", question, reply, sent_s)
            self._put(AlertArrival(key, reply.ok.payload.to_bytes(), request, doubt=doubt))

    def _put(self, arrival: AlertArrival) -> None:
        """Called from Zenoh's threads."""
        try:
            self._arrivals.put_nowait(arrival)
        except queue.Full:
            self.dropped += 1

    def _take_arrivals(self, timeout_s: float) -> Iterator[AlertEvent]:
        """Yield what follows from everything that has come; wait for the first of it."""
        held, self._held = self._held, []
        for arrival in held:
            yield from self._take(arrival)
        with suppress(queue.Empty):
            yield from self._take(self._arrivals.get(timeout=timeout_s))
            for _ in range(self._arrivals.qsize()):
                yield from self._take(self._arrivals.get_nowait())

    def _take(self, arrival: AlertArrival) -> Iterator[AlertEvent]:
        gateway = self._gateways.get(arrival.key) or self._add(arrival.key, None)
        if gateway is None:
            self.refused += 1
        elif arrival.payload is None:
            gateway.presence.is_alive = arrival.is_alive
        elif arrival.request is not None:
            if gateway.admit(arrival.doubt):
                yield from self._take_page(gateway, arrival, arrival.request, arrival.payload)
            else:
                self.refused += 1
        elif arrival.topic == "health":
            self._judge_health(gateway, arrival, arrival.payload)
        else:
            yield from self._judge_alert(gateway, arrival, arrival.payload)

    def _judge_health(self, gateway: HeardGateway, arrival: AlertArrival, payload: bytes) -> None:
        """Take a sign of life if it is the gateway's, as an alert; one that cannot be judged yet is followed by others."""
        doubt = self._authenticity.judge_message(arrival.key, "health", payload, arrival.attachment, arrival.at_s)
        if doubt is UNANSWERED:
            return
        try:
            health: Health = adapter("health").validate_json(payload)
        except ValidationError:
            self.refused += 1
            return
        if not gateway.admit(doubt):
            self.refused += 1
        elif doubt is None or not gateway.is_authentic:
            gateway.presence.hear(health, time.monotonic())

    def _judge_alert(self, gateway: HeardGateway, arrival: AlertArrival, payload: bytes) -> Iterator[AlertEvent]:
        """Take an alert if it is the gateway's, or no key of it is known; it waits until the gateway has answered."""
        doubt: Doubt | None = UNANSWERED
        if all(arrival.key != held.key for held in self._held):  # else it would overtake them
            doubt = self._authenticity.judge_message(arrival.key, "alert", payload, arrival.attachment, arrival.at_s)
        if doubt is UNANSWERED and time.monotonic() - arrival.at_s <= HOLD_S and len(self._held) < INBOX:
            self._held.append(arrival)
        elif gateway.admit(doubt):
            yield from self._take_alert(gateway, arrival, payload, doubt)
        else:
            self.refused += 1

    def _take_alert(
        self, gateway: HeardGateway, arrival: AlertArrival, payload: bytes, doubt: Doubt | None
    ) -> Iterator[AlertEvent]:
        try:
            alert: Alert = adapter("alert").validate_json(payload)
        except ValidationError:
            self.refused += 1
            return
        if doubt is None or not gateway.is_authentic:
            if gateway.presence.alert is None:
                gateway.state = None  # it is stated again where only a sign of life was heard: with what stands
            gateway.presence.hear(alert, time.monotonic())
        for change in gateway.sequence.take(alert):
            yield AlertEvent(arrival.key, change=change, doubt=doubt)

    def _take_page(
        self, gateway: HeardGateway, arrival: AlertArrival, request: AlertRequest, payload: bytes
    ) -> Iterator[AlertEvent]:
        try:
            page = AlertPage.model_validate_json(payload)
        except ValidationError:
            self.refused += 1
            return
        gateway.asked_s, gateway.waiting_since_s = float("-inf"), None
        yield from events_of(arrival.key, gateway.sequence.take_page(request, page), arrival.doubt)

    def _give_up(self) -> Iterator[AlertEvent]:
        """Go on where a gateway is heard and answers nothing."""
        now_s = time.monotonic()
        for key, gateway in self._gateways.items():
            if not gateway.sequence.is_waiting or is_overdue(now_s - gateway.presence.heard_s, PATIENCE_S):
                gateway.waiting_since_s = None
            elif gateway.waiting_since_s is None:
                gateway.waiting_since_s = now_s
            elif now_s - gateway.waiting_since_s > GIVE_UP_S:
                yield from events_of(key, gateway.sequence.give_up())

    def _ask(self) -> None:
        """Ask gateways whose alerts cannot be judged yet, and for missed changes, again where an answer does not come."""
        now_s = time.monotonic()
        if self._session is not None:
            self._authenticity.ask(self._session)
        for key, gateway in self._gateways.items():
            if self._session is None or not gateway.sequence.is_waiting or now_s - gateway.asked_s < ANSWER_S:
                continue
            request = gateway.sequence.ask()
            if request is None:
                continue
            gateway.asked_s = now_s
            wanted = {"after": request.position.number, "boot": request.position.boot_id}
            question = make_question(json.dumps(wanted).encode())
            with suppress(zenoh.ZError):  # the link is down
                take = partial(self._receive_page, key, request, question, now_s)
                send_question(self._session, f"{key}/rpc/alerts", question, ANSWER_S, take)

    def _judge(self) -> Iterator[AlertEvent]:
        """Yield the states that have changed; the first one once the gateway has spoken, or has had the time to."""
        now_s = time.monotonic()
        info = None if self._session is None else self._session.info
        is_linked = info is not None and bool(info.routers_zid() or info.peers_zid())
        if is_linked and not self._linked:
            for gateway in self._gateways.values():
                gateway.presence.connected_s = now_s
        self._linked = is_linked
        for key, gateway in self._gateways.items():
            state, doubt = gateway.judge(now_s, PATIENCE_S, is_linked=is_linked)
            has_had_time = is_overdue(now_s - gateway.presence.connected_s, PATIENCE_S)
            is_awaited = gateway.state is None and gateway.presence.alert is None and not has_had_time
            if state != gateway.state and not (is_awaited and state is GatewayState.NOT_KNOWN):
                gateway.state = state
                yield AlertEvent(key, state=state, standing=gateway.presence.alert, doubt=doubt)

    def _add(self, key: str, state: SequenceState | None) -> HeardGateway | None:
        """Return a new gateway; None for a key that no configuration allows, or for too many of them.

        Names that were never authenticated make room: they may be invented.
        """
        if len(self._gateways) >= MOST_FOLLOWED:
            doubtful = (name for name, each in self._gateways.items() if not (each.is_authentic or each.is_remembered))
            self._gateways.pop(next(doubtful, ""), None)
        if len(self._gateways) >= MOST_FOLLOWED or GATEWAY_KEY.fullmatch(key) is None:
            return None
        presence = GatewayPresence(connected_s=time.monotonic() if self._linked else float("-inf"))
        self._gateways[key] = HeardGateway(AlertSequence(self._since, state), presence, is_remembered=state is not None)
        return self._gateways[key]
