"""The private channel from the gateway to its page: bounded, never waiting, with the true age of every message."""

import json
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest

from gateway.daemon.commands.requests import RemoteRequest
from gateway.daemon.commands.rpc_server import PageRequests
from gateway.daemon.outputs.page_channel import MAX_WAITING_FRAMES, PageChannel, WaitingFrames
from gateway.page.channel import (
    ANSWER,
    MAX_FRAME_BYTES,
    PARAMETERS,
    PAST_ALERT,
    REQUEST,
    Frame,
    decode_frame,
    encode_frame,
    receive_frame,
)
from gateway.recalibration.requests import Acknowledge
from tests.values import present
from tests.waiting import PATIENCE_S

FIRST = Frame(PARAMETERS, 1.0, b"{}")
FULL = b"x" * 60_000


def _submit(request: RemoteRequest) -> None:
    reason = request.expect(Acknowledge).reason
    if reason == "busy":
        request.refuse("busy: too many requests are waiting")
    else:
        request.reply(reason == "yes", {"text": "done", "reason": "done"})


def acknowledgement(reason: str) -> str:
    return json.dumps({"id": "page-12345678", "by": "ann", "reason": reason})


@pytest.fixture
def channel() -> Iterator[PageChannel]:
    opened = PageChannel(PageRequests({"acknowledge": _submit}).answer)
    yield opened
    opened.close()


def _open(channel: PageChannel) -> socket.socket:
    page = channel.open(FIRST)
    page.settimeout(PATIENCE_S)
    assert receive_frame(page) == FIRST
    return page


def test_a_page_that_starts_gets_past_alerts_before_the_last_messages() -> None:
    channel = PageChannel(PageRequests({}).answer, lambda: [b"raised", b"x" * MAX_FRAME_BYTES, b"cleared"])
    channel.put("alert", b"standing")
    for _ in range(2):  # it starts again
        page = _open(channel)
        frames = [_receive(page) for _ in range(3)]
        assert [(frame.kind, frame.payload) for frame in frames] == [
            (PAST_ALERT, b"raised"),
            (PAST_ALERT, b"cleared"),
            ("alert", b"standing"),
        ]
        page.close()
    channel.close()


def _receive(page: socket.socket) -> Frame:
    return present(receive_frame(page))


def test_a_frame_survives_its_encoding() -> None:
    frame = Frame("alert", 12.5, b'{"a": "line\nline"}\n')
    assert decode_frame(encode_frame(frame)) == frame


@pytest.mark.parametrize("packet", [b"\n", b"alert\n{}", b"alert soon\n{}", b"\xff 1.0\n{}"])
def test_a_packet_of_wrong_form_is_refused(packet: bytes) -> None:
    with pytest.raises(ValueError, match=r".+"):
        decode_frame(packet)


def test_messages_arrive_in_order_with_the_time_of_their_making(channel: PageChannel) -> None:
    with _open(channel) as page:
        before_s = time.monotonic()
        channel.put("tilt", b"1")
        frame = _receive(page)
        assert (frame.kind, frame.payload) == ("tilt", b"1")
        assert before_s - 1e-3 <= frame.at_s <= time.monotonic() + 1e-3


def test_samples_do_not_reach_the_page(channel: PageChannel) -> None:
    with _open(channel) as page:
        channel.put("samples", b"1")
        channel.put("tilt", b"2")
        assert _receive(page).kind == "tilt"


def test_a_page_that_starts_again_gets_the_last_message_of_each_topic_with_its_age(channel: PageChannel) -> None:
    channel.put("calibration", b"old")
    channel.put("calibration", b"new")
    before_s = time.monotonic()
    with _open(channel) as page:
        frame = _receive(page)
        assert (frame.kind, frame.payload) == ("calibration", b"new")
        assert frame.at_s <= before_s
    with _open(channel) as page:
        assert _receive(page).payload == b"new"


def test_a_page_that_hangs_delays_nobody_and_loses_all_but_the_newest(channel: PageChannel) -> None:
    with _open(channel) as page:
        for _ in range(40):
            channel.put("tilt", FULL)  # more than the kernel keeps
        channel.put("tilt", b"newest")
        for number in range(3):
            channel.put("alert", b"%d" % number)
        frames = [_receive(page)]
        while frames[-1].payload != b"2":
            frames.append(_receive(page))
    assert [frame.payload for frame in frames if frame.payload != FULL] == [b"newest", b"0", b"1", b"2"]
    assert len(frames) < 20
    assert channel.dropped == 0, "what is replaced by design is no loss"


def test_alerts_wait_in_a_bounded_queue() -> None:
    waiting = WaitingFrames()
    for number in range(MAX_WAITING_FRAMES["alert"] + 5):
        waiting.put(Frame("alert", 0.0, b"%d" % number))
    assert waiting.lost == 5
    assert present(waiting.get()).payload == b"5"


def test_a_message_that_is_too_large_is_counted_and_not_sent(channel: PageChannel) -> None:
    with _open(channel) as page:
        channel.put("calibration", b"x" * MAX_FRAME_BYTES)
        channel.put("tilt", b"1")
        assert _receive(page).kind == "tilt"
    assert channel.dropped == 1


def test_the_end_of_the_gateways_side_ends_the_page(channel: PageChannel) -> None:
    with _open(channel) as page:
        channel.close()
        assert receive_frame(page) is None


def test_a_page_that_has_ended_disturbs_nobody(channel: PageChannel) -> None:
    _open(channel).close()
    for _ in range(100):
        channel.put("tilt", FULL)
    with _open(channel) as page:
        assert _receive(page).kind == "tilt"


def _ask(page: socket.socket, **request: object) -> object:
    page.send(encode_frame(Frame(REQUEST, 0.0, json.dumps(request).encode())))
    answer = _receive(page)
    assert answer.kind == ANSWER
    return json.loads(answer.payload)


ANSWERS: list[tuple[dict[str, Any], tuple[int | None, bool, str]]] = [
    ({"number": 7, "verb": "acknowledge", "payload": acknowledgement("yes")}, (7, True, "done")),
    ({"number": 8, "verb": "acknowledge", "payload": acknowledgement("no")}, (8, False, "done")),
    (
        {"number": 9, "verb": "acknowledge", "payload": acknowledgement("busy")},
        (9, False, "busy: too many requests are waiting"),
    ),
    ({"number": 11, "verb": "acknowledge", "payload": "{}"}, (11, False, "id: Field required")),
    ({"number": 10, "verb": "reboot", "payload": ""}, (10, False, "reboot is not available")),
    ({"hello": 1}, (None, False, "no request of the page")),
]


def test_requests_are_answered_by_their_number(channel: PageChannel) -> None:
    with _open(channel) as page:
        for request, (number, accepted, text) in ANSWERS:
            assert _ask(page, **request) == {"number": number, "accepted": accepted, "text": text}
