"""A time stamp proves its statement and its time, whatever becomes of its bytes; tried with `openssl ts`."""

import base64
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from rfc3161_client import Verifier

from gateway.errors import InputError
from gateway.messages import NewestStatement
from gateway.recording.chain.time_stamps import (
    NAME,
    StoredTimeStamp,
    TimeStampError,
    load_verifier,
    make_request,
    prove,
    prove_all,
    read_time_stamps,
    take_response,
)
from tests.system.time_stamp_authority import make_authority, openssl

STATEMENT = NewestStatement(gateway="plumbline/v1/yard/c1/hook", segment=7, sha256="5e" * 32, public_key="ab" * 32)
BITS_PER_BYTE = 3
"""Bits of each byte that are flipped; all of them were tried once."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("authority") / "tsa"
    make_authority(folder)
    return folder


@pytest.fixture(scope="module")
def verifier(folder: Path) -> Verifier:
    return load_verifier(folder / "ca.pem")


@pytest.fixture(scope="module")
def stamp(folder: Path) -> StoredTimeStamp:
    """A time stamp as the gateway stores it."""
    request, query, answer = make_request(STATEMENT), folder / "query.tsq", folder / "answer.tsr"
    query.write_bytes(request.as_bytes())
    openssl("ts", "-reply", "-config", folder / "openssl.cnf", "-queryfile", query, "-out", answer)
    line = take_response(request, STATEMENT, answer.read_bytes())
    with pytest.raises(TimeStampError, match="another request"):
        take_response(make_request(STATEMENT), STATEMENT, answer.read_bytes())
    (folder / NAME).write_bytes(line + b"\n{}\nnoise\n")
    (found,), others = read_time_stamps(folder / NAME)
    assert others == 2
    return found


@pytest.mark.slow
def test_no_flipped_bit_changes_what_is_proved(stamp: StoredTimeStamp, verifier: Verifier) -> None:
    whole, times = base64.b64decode(stamp.response), set[datetime]()
    for place in range(len(whole)):
        for bit in range(BITS_PER_BYTE):
            content = bytearray(whole)
            content[place] ^= 1 << (place + bit) % 8
            try:
                times.add(prove(replace(stamp, response=base64.b64encode(content).decode()), verifier).at)
            except TimeStampError:
                continue
    assert times <= {prove(stamp, verifier).at}


def test_a_time_stamp_is_of_its_statement_alone(stamp: StoredTimeStamp, verifier: Verifier) -> None:
    with pytest.raises(TimeStampError, match="proves nothing"):
        prove(replace(stamp, statement=replace(STATEMENT, sha256="00" * 32)), verifier)


def test_what_is_not_valid_is_counted_and_named(stamp: StoredTimeStamp, verifier: Verifier, folder: Path) -> None:
    assert stamp.statement == STATEMENT
    proven, remarks = prove_all([folder / NAME], verifier)
    assert [each.statement.segment for each in proven] == [7]
    assert "2 of 3 time stamps are not valid" in remarks[0]


def test_a_file_without_a_certificate_of_a_ca_is_refused(folder: Path) -> None:
    for name in ("tsa.pem", "tsa.key"):  # not its own issuer, no certificate
        with pytest.raises(InputError, match="has no certificate of a CA"):
            load_verifier(folder / name)
    with pytest.raises(InputError, match="no such file"):
        load_verifier(folder / "nowhere.pem")
