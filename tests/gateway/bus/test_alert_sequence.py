"""A receiver of alerts: each change exactly once and in order, whatever the link, the gateway and the receiver do."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.bus.alert_sequence import AlertPage, AlertRequest, AlertSequence, MissedChanges, SequenceState
from gateway.messages import Alert
from gateway.outbox import StoredChange, find_span, make_page, span_of

Change = tuple[str, int]


def alert(boot_id: str, number: int, *, is_change: bool = True) -> Alert:
    return Alert(
        time_ns=0,
        clock="synchronised",
        sequence=0,
        level="trip",
        event="raised" if is_change else "standing",
        boot_id=boot_id,
        alert_number=number,
        rule="swing" if is_change else None,
        active=[],
        text="",
    )


@dataclass
class Gateway:
    """A gateway with its outbox: what it has sent, and how it answers."""

    changes: list[Change] = field(default_factory=list)
    boot: int = 0
    number: int = 0

    @property
    def boot_id(self) -> str:
        return f"b{self.boot}"

    def change(self) -> Alert:
        self.number += 1
        self.changes.append((self.boot_id, self.number))
        return alert(self.boot_id, self.number)

    def heartbeat(self) -> Alert:
        return alert(self.boot_id, self.number, is_change=False)

    def answer(self, request: AlertRequest, most_changes: int = 3) -> AlertPage:
        kept = [StoredChange(boot_id, number, b"x") for boot_id, number in self.changes]
        is_known = find_span([span_of(kept)], request.position) is not None
        page = make_page(kept, request.position, most_changes, is_known=is_known)
        alerts = [alert(each.boot_id, each.number) for each in page.changes]
        return AlertPage(alerts=alerts, more=page.more, complete=page.complete)


class Receiver:
    """A receiver that keeps its state with what it has delivered."""

    def __init__(self, since: int | None = None) -> None:
        self.since = since
        self.sequence = AlertSequence(since)
        self.delivered: list[Change] = []
        self.missed: list[MissedChanges] = []

    def restart(self) -> None:
        state = self.sequence.state
        kept = None if state is None else SequenceState.model_validate_json(state.model_dump_json())
        self.sequence = AlertSequence(self.since, kept)

    def take(self, message: Alert) -> None:
        self.deliver(self.sequence.take(message))

    def take_page(self, request: AlertRequest, page: AlertPage) -> None:
        self.deliver(self.sequence.take_page(request, page))

    def catch_up(self, gateway: Gateway) -> "Receiver":
        while (request := self.sequence.ask()) is not None:
            self.take_page(request, gateway.answer(request))
        return self

    def deliver(self, events: Iterator[Alert | MissedChanges]) -> None:
        for event in events:
            if isinstance(event, MissedChanges):
                self.missed.append(event)
            else:
                self.delivered.append((event.boot_id or "", event.alert_number or 0))


def test_changes_in_order_are_passed_on_at_once() -> None:
    gateway, receiver = Gateway(), Receiver()
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    for _ in range(5):
        receiver.take(gateway.change())
        receiver.take(gateway.heartbeat())
    assert receiver.delivered == gateway.changes
    assert not receiver.sequence.is_waiting


def test_a_late_joiner_gets_the_changes_from_then_on_or_from_a_number_on() -> None:
    gateway = Gateway()
    for _ in range(10):
        gateway.change()
    from_now, from_four, all_of_them = Receiver(), Receiver(since=4), Receiver(since=0)
    messages = gateway.heartbeat(), gateway.change()
    for receiver in (from_now, from_four, all_of_them):
        for message in messages:
            receiver.take(message)
            receiver.catch_up(gateway)
    assert from_now.delivered == gateway.changes[10:]
    assert from_four.delivered == gateway.changes[4:]
    assert all_of_them.delivered == gateway.changes


def test_a_receiver_whose_first_message_is_a_change_gets_that_change() -> None:
    gateway, receiver = Gateway(), Receiver()
    gateway.change()
    receiver.take(gateway.change())
    assert receiver.catch_up(gateway).delivered == [("b0", 2)]


def test_the_changes_of_a_boot_that_was_missed_altogether_are_delivered() -> None:
    gateway, receiver = Gateway(), Receiver()
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    for _ in range(3):
        gateway.boot += 1
        gateway.change()
    receiver.take(gateway.heartbeat())
    assert receiver.catch_up(gateway).delivered == gateway.changes
    assert receiver.missed == []


def test_numbers_that_a_failed_disk_lets_occur_twice_are_two_changes() -> None:
    """Boot b0 sent 2 and 3 without storing them; b1 and b2 begin behind 1 again, and b1 was missed."""
    gateway, receiver = Gateway(), Receiver(since=0)
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    receiver.take(alert("b0", 2))
    receiver.take(alert("b0", 3))
    gateway.boot = 1
    gateway.change()
    gateway.boot = 2
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    assert receiver.delivered == [("b0", 1), ("b0", 2), ("b0", 3), ("b1", 2), ("b2", 3)]
    assert receiver.missed == []


def test_changes_that_the_gateway_has_deleted_are_said_to_be_missed() -> None:
    gateway, receiver = Gateway(), Receiver()
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    for _ in range(6):
        gateway.change()
    del gateway.changes[:4]
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    assert receiver.missed == [MissedChanges(2, 4)]
    assert receiver.delivered == [("b0", 1), ("b0", 5), ("b0", 6), ("b0", 7)]


def test_a_change_that_is_damaged_in_the_outbox_is_said_to_be_missed() -> None:
    gateway, receiver = Gateway(), Receiver()
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    gateway.change(), gateway.change(), gateway.change()
    del gateway.changes[2]
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    assert receiver.delivered == [("b0", 1), ("b0", 2), ("b0", 4)]
    assert receiver.missed == [MissedChanges(3, 3)]


def test_a_gateway_with_a_new_disk_is_heard_from_its_first_change_on() -> None:
    gateway, receiver = Gateway(number=500), Receiver()
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    gateway = Gateway(boot=7)
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    receiver.take(gateway.change())
    assert receiver.delivered == [("b0", 501), ("b7", 1), ("b7", 2)]
    assert receiver.missed == [MissedChanges(502, None)]


def test_an_answer_that_was_overtaken_counts_for_nothing() -> None:
    gateway, receiver = Gateway(), Receiver(since=0)
    receiver.take(gateway.change())
    request = receiver.sequence.ask()
    assert request is not None
    early = gateway.answer(request)
    receiver.take(gateway.change())
    again = receiver.sequence.ask()
    assert again is not None
    receiver.take_page(request, early)
    assert receiver.delivered == []
    receiver.take_page(again, gateway.answer(again))
    receiver.take_page(again, gateway.answer(again))
    assert receiver.delivered == gateway.changes
    assert receiver.missed == []


def test_a_gateway_that_does_not_number_its_changes_is_heard() -> None:
    receiver = Receiver()
    unnumbered = replace(alert("b", 1), boot_id=None, alert_number=None)
    assert list(receiver.sequence.take(unnumbered)) == [unnumbered]


@dataclass
class Link:
    """A link that loses, repeats and reorders messages, and loses answers."""

    gateway: Gateway
    receiver: Receiver
    delayed: list[Alert] = field(default_factory=list)
    answers: list[tuple[AlertRequest, AlertPage]] = field(default_factory=list)

    def send(self, message: Alert, fault: str) -> None:
        if fault == "delay":
            self.delayed.append(message)
        elif fault != "lose":
            self.receiver.take(message)
            if fault == "repeat":
                self.receiver.take(message)
            while self.delayed:
                self.receiver.take(self.delayed.pop())

    def do(self, step: str, fault: str) -> None:
        match step:
            case "change":
                self.send(self.gateway.change(), fault)
            case "heartbeat":
                self.send(self.gateway.heartbeat(), fault)
            case "restart gateway":
                self.gateway.boot += 1
            case "restart receiver":
                self.receiver.restart()
            case "ask" if (request := self.receiver.sequence.ask()) is not None:
                self.answers.append((request, self.gateway.answer(request)))
            case "answer" if self.answers:
                self.receiver.take_page(*self.answers.pop())
            case "lose answer":
                self.answers = self.answers[1:]


def test_a_gateway_that_answers_nothing_holds_up_no_alert_for_ever() -> None:
    gateway, receiver = Gateway(), Receiver()
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    receiver.take(gateway.change())
    gateway.change()
    receiver.take(gateway.change())
    receiver.take(gateway.heartbeat())
    gateway.change()
    receiver.take(gateway.change())
    assert receiver.delivered == [("b0", 1)]
    receiver.deliver(receiver.sequence.give_up())
    assert receiver.delivered == [("b0", 1), ("b0", 3), ("b0", 5)]
    assert receiver.missed == [MissedChanges(2, 2), MissedChanges(4, 4)]
    receiver.take(gateway.change())
    assert receiver.delivered[-1] == ("b0", 6)
    assert not receiver.sequence.is_waiting


def test_giving_up_at_a_heartbeat_says_what_is_missing() -> None:
    gateway, receiver = Gateway(), Receiver()
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    gateway.change(), gateway.change()
    receiver.take(gateway.heartbeat())
    receiver.deliver(receiver.sequence.give_up())
    assert (receiver.delivered, receiver.missed) == ([], [MissedChanges(1, 2)])


def test_a_message_with_an_invented_number_suppresses_no_later_change() -> None:
    gateway, receiver = Gateway(), Receiver()
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    receiver.take(gateway.change())
    for forged in (
        alert("b0", 10**9),
        alert("b0", 10**9),
        alert("elsewhere", 10**9),
        alert("b0", 10**9, is_change=False),
    ):
        receiver.take(forged)
        receiver.catch_up(gateway)
    for _ in range(3):
        receiver.take(gateway.change())
        receiver.take(gateway.heartbeat())
        receiver.catch_up(gateway)
    assert receiver.delivered == gateway.changes
    assert len(receiver.missed) <= 3


def test_a_boot_whose_numbers_begin_again_before_its_first_change_is_heard() -> None:
    """The disk could not be read at that start: the gateway numbers its changes from 1."""
    gateway, receiver = Gateway(number=100), Receiver()
    receiver.take(gateway.change())
    receiver.catch_up(gateway)
    gateway.boot, gateway.number = 1, 0
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    for _ in range(3):
        receiver.take(gateway.change())
        receiver.catch_up(gateway)
    assert receiver.delivered == gateway.changes
    assert receiver.missed == []


def test_a_playback_is_passed_on_although_nobody_can_be_asked() -> None:
    message = replace(alert("b", 7), clock="replayed")
    assert list(Receiver().sequence.take(message)) == [message]


STEPS = st.lists(
    st.sampled_from(
        ("change", "change", "heartbeat", "restart gateway", "restart receiver", "ask", "answer", "lose answer")
    ),
    max_size=60,
)


@pytest.mark.slow
@settings(max_examples=400)
@given(
    steps=STEPS,
    faults=st.lists(st.sampled_from(("pass", "pass", "lose", "repeat", "delay")), min_size=1),
    seen=st.booleans(),
)
def test_any_loss_repetition_order_and_restart_ends_with_each_change_once_and_in_order(
    steps: list[str], faults: list[str], *, seen: bool
) -> None:
    gateway, receiver = Gateway(), Receiver(since=0)
    link = Link(gateway, receiver)
    if seen:
        receiver.take(gateway.heartbeat())
        receiver.catch_up(gateway)
    for place, step in enumerate(steps):
        link.do(step, faults[place % len(faults)])
    receiver.take(gateway.heartbeat())
    receiver.catch_up(gateway)
    assert receiver.delivered == gateway.changes
    assert receiver.missed == []


@pytest.mark.parametrize("number", range(5))
def test_a_state_is_read_again(number: int) -> None:
    gateway, receiver = Gateway(), Receiver(since=0)
    for _ in range(number):
        receiver.take(gateway.change())
    receiver.catch_up(gateway)
    receiver.restart()
    receiver.take(gateway.change())
    assert receiver.catch_up(gateway).delivered == gateway.changes
