"""The security log: every refusal counts, and no flood fills the file."""

import json
import logging
from pathlib import Path

import pytest

from gateway.daemon.commands.security import Refusal, SecurityLog

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
