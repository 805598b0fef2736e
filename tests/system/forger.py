"""A hostile party on the bus, in a process of its own; it has no key of the gateway.

It passes on what the gateway sends with every alert taken out (`calm`), signed with a key of its own, with the signature of
another message, or not at all; repeats what was recorded (`replay`); answers requests in the gateway's place (`answer`); or is a
router of the site, with its certificate, that says it is a gateway, by what that has sent to others (`pose`).
"""

import json
import sys
import threading
import time
from pathlib import Path

import zenoh
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gateway.authorization.message_signature import MessageSigner, Question
from gateway.bus.router import router_configuration
from gateway.bus.session import TlsFiles
from gateway.pki.signing_key import SigningKey
from tests.gateway.pki.site import vouch

FORGED_NUMBER = 1_000_000_000
COPIES = 2
PAUSE_S = 0.05


def open_bus(endpoint: str) -> zenoh.Session:
    config = zenoh.Config()
    for name, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 60_000,
        "scouting/multicast/enabled": False,
    }.items():
        config.insert_json5(name, json.dumps(value))
    return zenoh.open(config)


def calm(session: zenoh.Session, key: str) -> None:
    """Send everything again as if there were no alert, some times for each true message."""
    own = SigningKey(Ed25519PrivateKey.generate())
    signers: dict[str, MessageSigner] = {}

    def forge(sample: zenoh.Sample) -> None:
        name, message = str(sample.key_expr), json.loads(sample.payload.to_bytes())
        if message.get("forged"):
            return
        message["forged"] = True  # a field that nobody knows is left out
        if name.endswith("/alert"):
            number = (message["alert_number"] or 0) + 1
            message |= {"level": "normal", "event": "cleared", "rule": "swing", "active": [], "text": "all normal"}
            message |= {"validity": "valid", "alert_number": number, "change": "swing cleared"}
        payload = json.dumps(message).encode()
        boot_id = message.get("boot_id") or "0" * 12
        signer = signers.setdefault(boot_id, MessageSigner(lambda: own, boot_id, time.monotonic_ns))
        theirs = None if sample.attachment is None else sample.attachment.to_bytes()
        pending.extend((name, payload, each) for each in (None, theirs, signer.sign_message(name, payload)))

    pending: list[tuple[str, bytes, bytes | None]] = []
    subscriber = session.declare_subscriber(f"{key}/*", forge)
    while True:
        taken, pending[:] = list(pending), []
        for _ in range(COPIES):
            for name, payload, attachment in taken:
                session.put(name, payload, attachment=attachment)
        time.sleep(PAUSE_S)
        assert subscriber is not None


def replay(session: zenoh.Session, recorded: Path) -> None:
    """Send what was recorded, in its order, without end."""
    messages = [json.loads(line) for line in recorded.read_text().splitlines()]
    token = session.liveliness().declare_token(f"{messages[0]['key'].rpartition('/')[0]}/alive")
    while True:
        for message in messages:
            session.put(
                message["key"], bytes.fromhex(message["payload"]), attachment=bytes.fromhex(message["attachment"])
            )
            time.sleep(PAUSE_S)
        assert token is not None


def answer(session: zenoh.Session, key: str, asked: Path) -> None:
    """Answer challenges with a time to come, and everything else with "accepted"; write what is asked into a file."""
    own = SigningKey(Ed25519PrivateKey.generate())
    signer = MessageSigner(lambda: own, "0" * 12, time.monotonic_ns)

    def reply(query: zenoh.Query) -> None:
        verb = str(query.key_expr).rpartition("/")[2]
        attachment = b"" if query.attachment is None else query.attachment.to_bytes()
        with asked.open("a") as file:
            file.write(json.dumps({"verb": verb, "attachment": attachment.hex()}) + "\n")
        content = {"accepted": True, "text": "forged", "id": ""}
        if verb == "challenge":
            content = {
                "boot_id": "0" * 12,
                "time_ns": time.monotonic_ns() + 90 * 10**9,
                "scheme": "token",
                "token_id": "0" * 16,
            }
        payload = json.dumps(content).encode()
        question = Question(b"" if query.payload is None else query.payload.to_bytes(), attachment)
        name = f"{key}/rpc/{verb}"
        with query:
            query.reply(name, payload, attachment=signer.sign_answer(name, payload, question, accepted=True))

    token = session.liveliness().declare_token(f"{key}/alive")
    queryable = session.declare_queryable(f"{key}/rpc/*", reply)
    assert token is not None
    assert queryable is not None
    threading.Event().wait()


def pose(endpoint: str, key: str, folder: Path, status: Path) -> None:
    """Answer, vouch for a key of its own and send what a gateway has sent, to those who connect to this router."""
    own = SigningKey(Ed25519PrivateKey.generate())
    signer = MessageSigner(lambda: own, "0" * 12, time.monotonic_ns)
    voucher = vouch(folder, key, own.public_hex).model_dump()
    topics = json.loads(status.read_text())
    challenge = {"boot_id": "0" * 12, "time_ns": time.monotonic_ns(), "scheme": "certificate", "voucher": voucher}

    def reply(query: zenoh.Query) -> None:
        verb = str(query.key_expr).rpartition("/")[2]
        done = {"accepted": True, "text": "forged", "id": ""}
        payload = json.dumps({"challenge": challenge, "status": topics}.get(verb, done)).encode()
        attachment = b"" if query.attachment is None else query.attachment.to_bytes()
        question = Question(b"" if query.payload is None else query.payload.to_bytes(), attachment)
        name = f"{key}/rpc/{verb}"
        with query:
            query.reply(name, payload, attachment=signer.sign_answer(name, payload, question, accepted=True))

    files = TlsFiles(*(folder / f"{name}.pem" for name in ("ca", "certificate", "key")))
    with zenoh.open(
        zenoh.Config.from_json5(json.dumps(router_configuration([endpoint], files, readers=["ann", "bob"])))
    ) as session:
        ends = session.liveliness().declare_token(f"{key}/alive"), session.declare_queryable(f"{key}/rpc/*", reply)
        print("ready", flush=True)
        while ends:
            for topic, message in topics.items():
                payload = json.dumps(message).encode()
                session.put(f"{key}/{topic}", payload, attachment=signer.sign_message(f"{key}/{topic}", payload))
            time.sleep(PAUSE_S)


if __name__ == "__main__":
    what, endpoint, *rest = sys.argv[1:]
    if what == "pose":
        pose(endpoint, rest[0], Path(rest[1]), Path(rest[2]))
    with open_bus(endpoint) as opened:
        print("ready", flush=True)
        if what == "calm":
            calm(opened, rest[0])
        elif what == "replay":
            replay(opened, Path(rest[0]))
        else:
            answer(opened, rest[0], Path(rest[1]))
