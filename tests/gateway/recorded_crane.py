"""A crane whose trolley starts hastily, recorded by the pipeline and the recorder in files of ten seconds."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from devices.simulated.crane import Crane
from devices.simulated.device import SimulatedCrane
from devices.simulated.schedule import TrolleyMove
from gateway.calibration.record import CalibrationRecord
from gateway.messages import Alert, FoxgloveTime, Health, HealthState, Log, Motion
from gateway.pipeline.outgoing_message import MessageTime, OutgoingMessage
from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.segment import calibration_files
from tests.clocks import START_NS, SleeplessClock
from tests.gateway.recording import recorded_crane
from tests.gateway.recording.recorded_crane import BOOT_ID, CLOCK

LENGTH_M, POSITION_M, RATE_HZ = 6.0, 4.0, 50.0
PERIOD_S = 2 * np.pi * np.sqrt(LENGTH_M / 9.80665)
START_S = 6.0
SEGMENT_S = 10.0
COMPACTED = 2
"""The first files are compacted, the others as they were written."""
LIMITS = {"warn_deg": 3.0, "trip_deg": 5.0, "clear_deg": 2.0, "hold_s": 2.0}
SETTINGS = {
    "gateway": {"site": "yard", "crane": "crane-2", "sensor": "hook"},
    "device": {"odr_hz": RATE_HZ},
    "rope": {"length_m": LENGTH_M},
    "housing": {"position_m": POSITION_M},
    "alerts": LIMITS,
}


@dataclass(frozen=True)
class RecordedCrane:
    """The files and what the pipeline had sent."""

    folder: Path
    messages: list[OutgoingMessage]

    @property
    def files(self) -> list[Path]:
        return sorted(self.folder.glob("*.mcap"))

    @property
    def changes(self) -> list[Alert]:
        """Changes of the incident."""
        found = (each.message for each in self.messages)
        return [each for each in found if isinstance(each, Alert) and each.incident == f"{BOOT_ID}-1"]

    @property
    def known_motions(self) -> list[Motion]:
        """The motions whose angle is known, while the incident lasts."""
        found = (each.message for each in self.messages)
        begin_ns, end_ns = self.changes[0].time_ns, self.changes[-1].time_ns
        motions = [each for each in found if isinstance(each, Motion) and begin_ns <= each.time_ns <= end_ns]
        return [each for each in motions if each.angle_deg is not None]

    @property
    def largest(self) -> Motion:
        return max(self.known_motions, key=lambda each: each.angle_deg or 0.0)


class HastyCrane(recorded_crane.RecordedCrane):
    """A trolley move that starts at START_S and whose swing dies down, with the log and the health of a gateway."""

    def __init__(
        self, folder: Path, boot_id: str = BOOT_ID, start_ns: int = START_NS, limits: dict[str, float] = LIMITS
    ) -> None:
        move = TrolleyMove(START_S, PERIOD_S, PERIOD_S / 2, 0.55, 0.6, "Trolley starts hastily")
        crane = Crane(length_m=LENGTH_M, position_m=POSITION_M, gravity_m_s2=9.80665, events=[move], damping_ratio=0.05)
        device = SimulatedCrane(
            odr_hz=RATE_HZ,
            block_samples=5,
            length_m=LENGTH_M,
            position_m=POSITION_M,
            clock=SleeplessClock(start_ns),
            crane=crane,
        )
        chain = SegmentChain(folder, "yard/crane-2/hook", load_or_create_key(folder / "signing-key.pem"))
        self.sent: list[OutgoingMessage] = []
        self.state: HealthState = "running"
        settings = {**SETTINGS, "alerts": limits}
        super().__init__(folder, SEGMENT_S, settings, device, chain, boot_id, start_ns)
        factory = self.info.factory_calibration
        if factory is not None:
            record = CalibrationRecord.model_validate(factory)
            self.recorder.set_calibration(calibration_files(record, None), self.newest_ns)

    def write(self, message: OutgoingMessage) -> None:
        super().write(message)
        self.sent.append(message)
        if isinstance(message.message, Alert) and message.message.change is not None:
            self.log(message.message.change, message.log_time_ns)

    def log(self, text: str, time_ns: int, name: str = "plumbline.alert") -> None:
        """Write a line of the log."""
        utc_ns = MessageTime(time_ns, CLOCK).utc_ns
        time = FoxgloveTime(sec=utc_ns // 10**9, nsec=utc_ns % 10**9)
        self.write(OutgoingMessage("log", time_ns, Log(timestamp=time, level=3, message=text, name=name)))

    def second_messages(self, now: MessageTime) -> Iterator[OutgoingMessage]:
        yield from super().second_messages(now)
        health = Health(
            **self.headers.make("health", now, None),
            state=self.state,
            device_id="simulated-1",
            device_kind="simulated",
            boot_id=self.boot_id,
            software="0.1.0",
            uptime_s=1.0,
            measured_rate_hz=RATE_HZ,
            samples=round((now.log_time_ns - self.start_ns) * 1e-9 * RATE_HZ),
            lost=0,
            invalid=0,
            faults={},
            dropped={},
            recording=None,
            recording_error=None,
            disk_free_mb=1e4,
            cpu_percent=3.0,
            resident_mb=60.0,
        )
        yield OutgoingMessage("health", now.log_time_ns, health)


def record_crane(folder: Path, seconds: float = 45.0) -> RecordedCrane:
    """Record so many seconds of the hasty crane."""
    crane = HastyCrane(folder)
    crane.record(seconds)
    crane.close()
    for path in crane.recorder.take_uncompacted()[:COMPACTED]:
        compact(path, crane.chain)
    return RecordedCrane(folder, crane.sent)
