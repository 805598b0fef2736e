"""The answer to `rpc/alerts`: the changes of alerts behind the last one that a receiver has."""

import msgspec

from gateway.daemon.outbox_writer import OutboxWriter
from gateway.daemon.remote_request import RemoteRequest
from gateway.outbox.position import Position
from gateway.recalibration.requests import FetchAlerts


class AlertHistory:
    """Reads the outbox; used by the thread of the remote calls alone."""

    def __init__(self, outbox: OutboxWriter) -> None:
        self._outbox = outbox

    def answer(self, request: RemoteRequest) -> None:
        """Answer with a page of changes, oldest first."""
        wanted = request.expect(FetchAlerts)
        try:
            page = self._outbox.page_after(Position(wanted.after, wanted.boot))
        except OSError as error:
            request.refuse(f"the outbox cannot be read: {error.strerror or error}")
            return
        alerts = [msgspec.json.decode(change.payload) for change in page.changes]
        request.reply(True, {"alerts": alerts, "more": page.more, "complete": page.complete})
