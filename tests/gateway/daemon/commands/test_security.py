"""The security log, in which every refusal counts and which no flood fills, and the file of the command token."""

import json
import logging
import stat
from pathlib import Path

import pytest

from gateway.daemon.commands.security import Refusal, SecurityLog, load_or_create_token

REFUSAL = Refusal("rpc/cancel", "no_credential", None, "no credential")


def lines(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_a_refusal_is_written_at_once_with_who(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "security.jsonl"
    log = SecurityLog(path)
    with caplog.at_level(logging.WARNING, "plumbline.security"):
        log.add(REFUSAL, lambda: "tcp/10.0.0.9:4711", 0)
    (entry,) = lines(path)
    assert (entry["origin"], entry["key"], entry["kind"], entry["count"]) == (
        "tcp/10.0.0.9:4711",
        "rpc/cancel",
        "no_credential",
        1,
    )
    assert "rpc/cancel by tcp/10.0.0.9:4711" in caplog.text


@pytest.mark.slow
def test_a_flood_of_a_day_leaves_a_few_lines_that_count_all_of_it(tmp_path: Path) -> None:
    path = tmp_path / "security.jsonl"
    log = SecurityLog(path)
    n_refusals = 86_400
    for second in range(n_refusals):
        log.add(REFUSAL, lambda: "tcp/10.0.0.9:4711", second * 10**9)
    entries = lines(path)
    assert log.counts == {"no_credential": n_refusals}
    assert len(entries) < 40
    assert sum(int(str(entry["count"])) for entry in entries) > n_refusals - 3601


def test_many_names_at_once_are_limited_too(tmp_path: Path) -> None:
    path = tmp_path / "security.jsonl"
    log = SecurityLog(path)
    for number in range(10_000):
        log.add(Refusal("rpc/cancel", "wrong_role", f"name-{number}", "no"), lambda: "tcp", number * 10**6)
    assert len(lines(path)) < 40
    assert log.counts["wrong_role"] == 10_000


def test_a_disk_that_cannot_be_written_is_counted_and_refuses_nothing_else(tmp_path: Path) -> None:
    log = SecurityLog(tmp_path / "file" / "security.jsonl")
    (tmp_path / "file").write_text("a file where a folder should be")
    log.add(REFUSAL, lambda: "tcp", 0)
    assert (log.write_failures, log.counts["no_credential"]) == (1, 1)


def test_the_token_is_made_once_and_only_the_group_may_read_it(tmp_path: Path) -> None:
    secret = load_or_create_token(tmp_path)
    path = tmp_path / "command-token"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert bytes.fromhex(path.read_text()) == secret == load_or_create_token(tmp_path)
    assert load_or_create_token(tmp_path / "other") != secret


@pytest.mark.parametrize("content", [b"", b"00", b"zz" * 32, b"\xff\xfe"])
def test_a_damaged_token_lets_nobody_in_and_is_not_replaced(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "command-token"
    path.write_bytes(content)
    secrets = {load_or_create_token(tmp_path) for _ in range(2)}
    assert len(secrets) == 2  # random each time: known to nobody
    assert path.read_bytes() == content


def test_a_folder_that_cannot_be_written_lets_nobody_in(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file where a folder should be")
    assert load_or_create_token(tmp_path / "file") != load_or_create_token(tmp_path / "file")
