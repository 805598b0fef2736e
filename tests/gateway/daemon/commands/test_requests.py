"""Requests that wait for a thread: bounded, answered once, and what was refused is not carried out later."""

from collections.abc import Mapping
from typing import Any

import pytest

from gateway.daemon.commands.requests import BUSY, RemoteRequest, RequestQueue
from gateway.recalibration.requests import Cancel
from tests.values import present

HANGS = "could not be executed: the disk does not answer"


class Client:
    """Submits requests and keeps the answers by id."""

    def __init__(self, size: int = 4) -> None:
        self.queue = RequestQueue(size)
        self.answers: list[tuple[str, str]] = []

    def submit(self, request_id: str) -> None:
        def reply(accepted: bool, content: Mapping[str, Any]) -> None:
            self.answers.append((request_id, content["text" if accepted else "reason"]))

        self.queue.submit(RemoteRequest("cancel", Cancel(id=request_id, by="ann"), None, reply))


def test_requests_are_taken_in_order_and_too_many_are_refused_and_counted() -> None:
    client = Client(size=2)
    for name in ("request-1", "request-2", "request-3"):
        client.submit(name)
    assert client.answers == [("request-3", BUSY)]
    assert client.queue.dropped == 1
    taken = [client.queue.take() for _ in range(3)]
    assert [None if each is None else each.expect(Cancel).id for each in taken] == ["request-1", "request-2", None]


def test_what_is_not_begun_is_refused_and_cannot_begin_or_be_answered_later() -> None:
    client = Client()
    client.submit("request-1")
    client.submit("request-2")
    request = present(client.queue.take())
    client.queue.refuse(HANGS)
    client.queue.refuse(HANGS)
    assert client.answers == [("request-1", HANGS), ("request-2", HANGS)]
    with pytest.raises(TimeoutError, match="does not answer"):
        request.begin()
    request.reply(True, {"text": "done"})
    assert len(client.answers) == 2
    assert client.queue.take() is None


def test_a_request_that_has_begun_is_not_refused_nor_is_its_copy() -> None:
    client = Client()
    for name in ("request-1", "request-1", "request-2"):
        client.submit(name)
    request = present(client.queue.take())
    request.begin()
    client.queue.refuse(HANGS)
    assert client.answers == [("request-2", HANGS)]
    request.reply(True, {"text": "done"})
    present(client.queue.take()).reply(True, {"text": "done"})
    assert client.answers[1:] == [("request-1", "done")] * 2
