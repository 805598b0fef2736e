"""`python -m tests.benchmarks.fleet_gateways ENDPOINT TEMPLATES FIRST COUNT`: many simulated gateways in one process.

Each has its own session, liveliness token and status query, and sends at the rates of a real gateway what one has sent, with new
times. Sampling, filters and the recorder are left out. A line of JSON goes to the standard output every 0.2 s.
"""

import heapq
import json
import random
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import zenoh
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gateway.authorization.message_signature import MessageSigner, Question
from gateway.bus.session import open_session
from gateway.pki.signing_key import SigningKey

PERIODS_S = {
    "samples": 0.1,
    "tilt": 0.1,
    "motion": 0.1,
    "condition": 0.5,
    "swing": 1.0,
    "alert": 1.0,
    "health": 1.0,
    "calibration": 10.0,
}

REPORT_S = 0.2


class SimulatedGateway:
    """One gateway on the bus."""

    def __init__(self, endpoint: str, number: int, templates: dict[str, dict[str, Any]]) -> None:
        self._session = open_session("client", [endpoint], [])
        key = f"plumbline/v1/site-{number % 4}/crane-{number:03d}/hook"
        self._templates = {topic: dict(message) for topic, message in templates.items()}
        boot_id = self._templates["health"]["boot_id"] = f"{number:012x}"
        key_pair = SigningKey(Ed25519PrivateKey.generate())
        self._key = key
        self._signer = MessageSigner(lambda: key_pair, boot_id, time.monotonic_ns)
        self._publishers = {
            topic: self._session.declare_publisher(
                f"{key}/{topic}",
                encoding=zenoh.Encoding.APPLICATION_JSON,
                congestion_control=zenoh.CongestionControl.DROP,
            )
            for topic in templates
        }
        self._alive = self._session.liveliness().declare_token(f"{key}/alive")
        self._status = self._session.declare_queryable(f"{key}/rpc/status", partial(self._answer, f"{key}/rpc/status"))

    def _answer(self, key: str, query: zenoh.Query) -> None:
        kept = msgspec.json.encode({topic: each for topic, each in self._templates.items() if topic != "samples"})
        question = Question(b"", b"" if query.attachment is None else query.attachment.to_bytes())
        with query:
            query.reply(key, kept, attachment=self._signer.sign_answer(key, kept, question, accepted=True))

    @property
    def connected(self) -> bool:
        """Whether it is connected to the router."""
        return bool(self._session.info.routers_zid())

    def send(self, topic: str) -> None:
        """Send a message with the present time."""
        message = self._templates[topic]
        message["time_ns"] = time.time_ns()
        payload = msgspec.json.encode(message)
        signed = topic != "samples"
        signature = self._signer.sign_message(f"{self._key}/{topic}", payload) if signed else None
        self._publishers[topic].put(payload, attachment=signature)


def main(endpoint: str, templates: Path, first: int, count: int) -> None:
    """Send until the process is ended."""
    messages: dict[str, dict[str, Any]] = json.loads(templates.read_text())
    gateways = [SimulatedGateway(endpoint, first + k, messages) for k in range(count)]
    begun_s = time.monotonic()
    due = [(begun_s + random.random() * PERIODS_S[topic], k, topic) for k in range(count) for topic in messages]
    heapq.heapify(due)
    sent, late_s, report_s = 0, 0.0, begun_s + REPORT_S
    while True:
        at_s, k, topic = due[0]
        now_s = time.monotonic()
        if now_s >= report_s:
            connected = sum(gateway.connected for gateway in gateways)
            print(json.dumps({"sent": sent, "late_s": round(late_s, 3), "connected": connected}), flush=True)
            report_s, late_s = now_s + REPORT_S, 0.0
        if at_s > now_s:
            time.sleep(at_s - now_s)
            continue
        late_s = max(late_s, now_s - at_s)
        gateways[k].send(topic)
        sent += 1
        heapq.heapreplace(due, (max(at_s + PERIODS_S[topic], now_s - 1.0), k, topic))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
