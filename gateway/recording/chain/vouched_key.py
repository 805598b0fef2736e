"""The key of recordings for which the site's CA vouches, by the vouchers in the segments."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gateway.bus.known_gateways import RefuseKey
from gateway.file_input import parse_json
from gateway.recording.chain.statements import SIGNATURE, parse_statement
from gateway.recording.reading.recording_file import read_index


@dataclass(frozen=True, slots=True)
class VouchedKey:
    """What the CA says of recordings."""

    gateway: str = ""
    public_key: str | None = None
    """None: it does not vouch for any key in them."""
    refusal: str | None = None
    """Why it does not; None also where it was not asked: no segment has a voucher."""


def find_vouched_key(paths: Sequence[Path], refuse: RefuseKey) -> VouchedKey:
    """Return the newest key in recordings for which a CA vouches; `paths` are in order of time.

    Whether the recordings are signed with it is not looked at. Raises `RecordingError` for a file that cannot be read.
    """
    refused = VouchedKey()
    for path in reversed(paths):
        index = read_index(path)
        statement = parse_statement(index.metadata.get(SIGNATURE, {}).get("statement", ""))
        if statement is None or not index.voucher:
            continue
        try:
            why = refuse(statement.gateway, statement.public_key, parse_json(index.voucher))
        except ValueError:
            why = "its voucher cannot be read"
        if why is None:
            return VouchedKey(statement.gateway, statement.public_key)
        refused = VouchedKey(refusal=refused.refusal or f"{path.name}: {why}")
    return refused
