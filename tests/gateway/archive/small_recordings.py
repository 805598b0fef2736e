"""Signed recordings of many cranes, small and quick to make by the recorder of the gateway; the rows of an archive that count."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import sin
from pathlib import Path
from typing import Any

from gateway import messages
from gateway.archive.admission import known_key, read_keys
from gateway.archive.index import IndexResult, index
from gateway.archive.query import open_database
from gateway.archive.rows import RECORDINGS, TABLES
from gateway.archive.source import open_source
from gateway.archive.tables import Archive
from gateway.pipeline.outgoing_message import encode_message
from gateway.pki.signing_key import load_or_create_key, read_public_key
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS

NS_PER_S = 1_000_000_000
LIMIT_DEG = 5.0


@dataclass
class SmallCrane:
    """A crane that swings up to `peak_deg`, recorded at one message of each topic a second."""

    folder: Path
    """Of its recordings and its key."""
    crane: str = "crane-1"
    site: str = "yard"
    peak_deg: float = 6.0
    segments: int = 3
    segment_s: int = 20
    start_ns: int = START_NS
    wall_offset_ns: int = 0
    boot: str = "b00t"
    calibration: dict[str, Any] = field(default_factory=dict)
    """The record."""
    voucher: str | None = None
    """Of the CA for the key."""
    closed: bool = True
    """False: the last segment is cut off, as by a power failure."""
    sent: list[messages.Motion] = field(default_factory=list)

    @property
    def gateway(self) -> str:
        return f"{self.site}/{self.crane}/hook"

    @property
    def public_key(self) -> str:
        return read_public_key(str(self.folder / "signing-key.pem.pub"))

    @property
    def files(self) -> list[Path]:
        return sorted(self.folder.glob("*.mcap"))

    def record(self) -> "SmallCrane":
        """Write the segments."""
        chain = self._chain()
        header = RecordingHeader("0.2.0", self.site, self.crane, "hook", self.boot, "", lambda: self.voucher)
        recorder = Recorder(self.folder, header, segment_s=self.segment_s, fsync_s=1.0, quota_mb=1000.0, chain=chain)
        recorder.start(self.start_ns)
        for second in range(self.segments * self.segment_s - 1):
            now_ns = self.start_ns + second * NS_PER_S
            for topic, message in self._messages(second, now_ns):
                recorder.write(encode_message(topic, message, now_ns))
            recorder.tick(now_ns)
        if self.closed:
            recorder.close()
        for path in recorder.take_uncompacted():
            compact(path, chain)
        return self

    def repair(self) -> None:
        """Complete and sign what was cut off, as the gateway does at its next start."""
        for path in self.files:
            compact(path, self._chain())

    def _chain(self) -> SegmentChain:
        return SegmentChain(self.folder, self.gateway, load_or_create_key(self.folder / "signing-key.pem"))

    def _messages(self, second: int, now_ns: int) -> Iterator[tuple[str, messages.Message]]:
        angle_deg = abs(self.peak_deg * sin(0.3 * second))
        common: dict[str, Any] = {"time_ns": now_ns + self.wall_offset_ns, "clock": "synchronised", "sequence": second}
        calibrated = {**common, "calibration_id": "c-1"}
        known = second >= 2
        motion = messages.Motion(
            **calibrated,
            state="free" if known else "unknown",
            angle_deg=angle_deg if known else None,
            u_deg=0.1 if known else None,
            lean_deg=0.2,
            reasons=[],
            text="",
        )
        self.sent.append(motion)
        yield (
            "clock",
            messages.ClockOffset(**common, log_time_ns=now_ns, wall_offset_ns=self.wall_offset_ns, stepped=False),
        )
        yield "motion", motion
        yield (
            "swing",
            messages.Swing(
                **calibrated,
                swinging=known,
                phi_max_deg=self.peak_deg if known else None,
                u_deg=0.1,
                period_s=5.0,
                formulas_deg=messages.Formulas(),
                reasons=[],
            ),
        )
        yield (
            "condition",
            messages.Condition(
                **calibrated,
                verdict="swinging" if known else "unknown",
                trusted=known,
                reasons=[] if known else [f"only {second}.5 s of data"],
                gates={},
                calibration="calibrated",
            ),
        )
        yield "alert", self._alert(second, calibrated, angle_deg)
        yield "health", self._health(second, calibrated)
        if second % 10 == 0:
            yield (
                "calibration",
                messages.Calibration(
                    **calibrated,
                    status="calibrated",
                    device_id=f"part-{self.crane}",
                    record=self.calibration,
                    in_force={},
                    text="c-1",
                ),
            )

    def _alert(self, second: int, common: dict[str, Any], angle_deg: float) -> messages.Alert:
        raised_s = 5
        is_raised = self.peak_deg >= LIMIT_DEG and second >= raised_s
        active = messages.ActiveAlert(
            rule="swing",
            level="trip",
            since_ns=self.start_ns + raised_s * NS_PER_S,
            value_deg=angle_deg,
            limit_deg=LIMIT_DEG,
            incident=f"{self.crane}-1",
            largest_deg=self.peak_deg,
            largest_upper_deg=self.peak_deg + 0.2,
            text="swing",
        )
        return messages.Alert(
            **common,
            level="trip" if is_raised else "normal",
            validity="valid" if second >= 2 else "not_known",
            event="raised" if second == raised_s and is_raised else "standing",
            rule="swing" if second == raised_s and is_raised else None,
            incident=f"{self.crane}-1" if second == raised_s and is_raised else None,
            active=[active] if is_raised else [],
            text="",
        )

    def _health(self, second: int, common: dict[str, Any]) -> messages.Health:
        return messages.Health(
            **common,
            state="running",
            device_id=f"part-{self.crane}",
            device_kind="adxl355",
            boot_id=self.boot,
            software="0.2.0",
            uptime_s=float(second),
            measured_rate_hz=1000.0,
            samples=1000 * second,
            lost=0,
            invalid=0,
            faults={"overrun": 1},
            dropped={},
        )


def indexed(source: Path, table: Path, keys: Path | None = None) -> IndexResult:
    return index(open_source(str(source)), Archive(str(table)), known_key if keys is None else read_keys(keys))


def index_process(source: Path, table: Path, keys: Path) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "gateway", "archive", "index", source, "--into", table, "--keys", keys]
    return subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def keys_file(path: Path, *cranes: SmallCrane) -> Path:
    path.write_text("".join(f"{crane.gateway}  {crane.public_key}\n" for crane in cranes))
    return path


def content(table: Path) -> dict[str, list[str]]:
    """Every row that counts, and the files with their status; what a store says of a file's version is its own."""
    chosen = dict.fromkeys(TABLES, "*") | {RECORDINGS: "* EXCLUDE (version)"}
    with open_database(Archive(str(table))) as database:
        return {
            name: sorted(map(repr, database.execute(f"SELECT {columns} FROM {name}").fetchall()))
            for name, columns in chosen.items()
        }


def select(table: Path, sql: str) -> list[tuple[Any, ...]]:
    """Rows of an answer, without the question of what is verified."""
    with open_database(Archive(str(table))) as database:
        return database.execute(sql).fetchall()
