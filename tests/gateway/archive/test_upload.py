"""Finished segments reach the store once, whatever happens on the way, and nothing in it is changed."""

import subprocess
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import obstore
import pytest
from obstore.store import LocalStore

from gateway.archive.query import ask
from gateway.archive.source import open_object_store
from gateway.archive.tables import Archive
from gateway.archive.upload import Uploader, UploadLimits, UploadResult, open_destination, parse_window
from gateway.cli.main import main
from gateway.errors import ANSWER_IS_NO, BAD_INPUT
from tests.gateway.archive.s3_server import S3Server, running_s3
from tests.gateway.archive.small_recordings import SmallCrane, content
from tests.ports import unused_port
from tests.waiting import PATIENCE_S, wait_until

MORNING = datetime(2026, 1, 1, 6, 0, tzinfo=UTC)
NIGHT = datetime(2026, 1, 1, 23, 0, tzinfo=UTC)
NO_LIMITS = UploadLimits()


@pytest.fixture(scope="module")
def s3() -> Iterator[S3Server]:
    with running_s3() as server:
        yield server


def credentials(path: Path, server: S3Server) -> Path:
    path.write_text("".join(f'{name} = "{value}"\n' for name, value in server.settings.items()))
    path.chmod(0o600)
    return path


def sent(folder: Path, store: Path, limits: UploadLimits = NO_LIMITS, now: datetime = MORNING) -> UploadResult:
    return Uploader(folder, open_destination(str(store), None), limits, lambda: now, time.sleep).run(lambda _: None)


def names(store: Path) -> list[str]:
    return sorted(str(path.relative_to(store)) for path in store.rglob("*.mcap"))


def upload_process(folder: Path, *options: str, server: S3Server) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "gateway", "archive", "upload", str(folder), *options]
    return subprocess.Popen(
        command, env=server.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


@pytest.mark.slow
def test_segments_are_sent_to_an_object_store_and_indexed_from_there(
    fleet: list[SmallCrane], keys: Path, clean: Path, s3: S3Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    secret = credentials(tmp_path / "s3.toml", s3)
    store = f"s3://{s3.bucket}/all"
    for crane in fleet:
        assert main(["archive", "upload", str(crane.folder), "--to", store, "--credentials", str(secret)]) == 0
    for name, value in s3.environment.items():
        monkeypatch.setenv(name, value)
    assert main(["archive", "index", store, "--into", f"s3://{s3.bucket}/table", "--keys", str(keys)]) == 0
    assert main(["archive", "index", store, "--into", str(tmp_path / "table"), "--keys", str(keys)]) == 0
    assert content(tmp_path / "table")["motion"] == content(clean)["motion"]
    sql = "SELECT crane, max(phi_max_deg), min(trust) FROM swings GROUP BY crane ORDER BY crane"
    answer = ask(Archive(f"s3://{s3.bucket}/table"), sql)
    assert answer.rows == (("crane-1", 6.0, "verified"), ("crane-2", 3.0, "verified"), ("crane-3", 8.0, "verified"))


def test_a_second_pass_sends_nothing(fleet: list[SmallCrane], tmp_path: Path) -> None:
    assert sent(fleet[0].folder, tmp_path / "store").sent == 3
    assert sent(fleet[0].folder, tmp_path / "store") == UploadResult(0, 0, 3, 0, 0, ())
    first = names(tmp_path / "store")[0]
    assert first.startswith(f"yard/crane-1/hook/{fleet[0].files[0].stem}-")


def test_what_was_deleted_in_the_store_is_not_sent_again(tmp_path: Path) -> None:
    crane, store, table = SmallCrane(tmp_path / "data").record(), tmp_path / "store", tmp_path / "table"
    assert sent(crane.folder, store).sent == 3
    assert main(["archive", "index", str(store), "--into", str(table)]) == 0
    rule = ["--before", "2030-01-01", "--by", "ann", "--because", "kept for a year", "--yes"]
    assert main(["archive", "delete", str(store), "--table", str(table), *rule]) == 0
    assert names(store) == []
    assert sent(crane.folder, store) == UploadResult(0, 0, 3, 0, 0, ())
    assert names(store) == []


@pytest.mark.slow
def test_an_upload_that_was_killed_goes_on_where_it_was(fleet: list[SmallCrane], s3: S3Server) -> None:
    prefix = f"s3://{s3.bucket}/killed"
    store = open_object_store(prefix, s3.settings)

    def there() -> list[str]:
        return sorted(meta["path"] for chunk in obstore.list(store) for meta in chunk)

    process = upload_process(fleet[0].folder, "--to", prefix, "--rate", "1", server=s3)
    wait_until(lambda: there() or process.poll() is not None, "the first segment")
    process.kill()
    process.communicate()
    before = there()
    assert 0 < len(before) < 3
    process = upload_process(fleet[0].folder, "--to", prefix, server=s3)
    said, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, said
    assert f"{3 - len(before)} segments sent" in said
    assert len(there()) == 3


@pytest.mark.slow
def test_an_upload_outlives_an_outage_of_the_store(fleet: list[SmallCrane]) -> None:
    port = unused_port()
    with running_s3(port) as server:
        process = upload_process(fleet[0].folder, "--to", f"s3://{server.bucket}/x", "--every", "0.01", server=server)
        assert process.stdout is not None
        wait_until(lambda: "sent as" in process.stdout.readline(), "the first segment")  # type: ignore[union-attr]
    with running_s3(port) as server:  # it comes back empty
        store = open_object_store(f"s3://{server.bucket}/x", server.settings)
        wait_until(lambda: sum(map(len, obstore.list(store))) == 3, "all segments")
        process.kill()
        process.communicate()


def test_what_lies_in_the_store_is_never_written_again(fleet: list[SmallCrane], s3: S3Server, tmp_path: Path) -> None:
    """A thief with the rights of the gateway finds the name of a segment taken."""
    for store in (open_object_store(f"s3://{s3.bucket}/once", s3.settings), LocalStore(tmp_path)):
        obstore.put(store, "segment.mcap", b"true", mode="create", use_multipart=False)
        with pytest.raises(obstore.exceptions.AlreadyExistsError):
            obstore.put(store, "segment.mcap", b"forged", mode="create", use_multipart=False)
        assert bytes(obstore.get(store, "segment.mcap").bytes()) == b"true"


@pytest.mark.slow
def test_only_finished_segments_are_sent(tmp_path: Path) -> None:
    crane = SmallCrane(tmp_path / "crane", segments=2, closed=False).record()
    crane.files[0].with_name(crane.files[0].name + ".live").touch()  # waits to be rewritten
    assert sent(crane.folder, tmp_path / "store") == UploadResult(0, 0, 0, 0, 2, ())
    crane.files[0].with_name(crane.files[0].name + ".live").unlink()
    found = sent(crane.folder, tmp_path / "store")
    assert (found.sent, found.unfinished) == (1, 1)


@pytest.mark.slow
def test_a_segment_that_differs_from_its_signature_is_named_and_not_sent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    crane = SmallCrane(tmp_path / "crane", segments=2).record()
    changed = bytearray(crane.files[0].read_bytes())
    changed[len(changed) // 2] ^= 1
    crane.files[0].write_bytes(changed)
    assert main(["archive", "upload", str(crane.folder), "--to", str(tmp_path / "store")]) == ANSWER_IS_NO
    assert f"not sent: {crane.files[0]}: ALTERED" in capsys.readouterr().err
    assert len(names(tmp_path / "store")) == 1


def test_nothing_is_sent_outside_the_window(fleet: list[SmallCrane], tmp_path: Path) -> None:
    limits = UploadLimits(window=parse_window("22:00-05:00"))
    assert sent(fleet[0].folder, tmp_path / "store", limits, MORNING).left == 3
    assert names(tmp_path / "store") == []
    assert sent(fleet[0].folder, tmp_path / "store", limits, NIGHT).sent == 3


@pytest.mark.parametrize(
    ("window", "wait_h"), [("22:00-05:00", 16.0), ("06:00-07:00", 0.0), ("05:00-06:00", 23.0), ("07:30-08:00", 1.5)]
)
def test_the_wait_for_a_window(window: str, wait_h: float) -> None:
    assert parse_window(window).wait_s(MORNING) == 3600 * wait_h


def test_the_mean_rate_is_kept(fleet: list[SmallCrane], tmp_path: Path) -> None:
    slept_s: list[float] = []
    store = open_destination(str(tmp_path / "store"), None)
    uploader = Uploader(fleet[0].folder, store, UploadLimits(1000.0), lambda: MORNING, slept_s.append)
    found = uploader.run(lambda _: None)
    assert sum(slept_s) == pytest.approx(found.sent_bytes / 1000)


def test_credentials_that_others_may_read_are_refused(
    fleet: list[SmallCrane], s3: S3Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    secret = credentials(tmp_path / "s3.toml", s3)
    secret.chmod(0o644)
    arguments = ["archive", "upload", str(fleet[0].folder), "--to", f"s3://{s3.bucket}/x", "--credentials", str(secret)]
    assert main(arguments) == BAD_INPUT
    assert (
        capsys.readouterr().err
        == f"plumbline archive: --credentials {secret}: others may read it; chmod 600 {secret}\n"
    )


@pytest.mark.parametrize("window", ["22:00", "25:00-26:00", "05:00-05:00", "night"])
def test_a_window_that_is_none_is_refused(window: str) -> None:
    with pytest.raises(ValueError, match="such as 22:00-05:00"):
        parse_window(window)
