"""A recording of the simulated crane by the gateway's own pipeline and recorder, as fast as it is computed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from devices.block import DeviceInfo, SampleBlock
from devices.simulated.device import SimulatedCrane
from gateway import __version__
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.drift.rest_monitor import RestDriftMonitor
from gateway.calibration.record import CalibrationRecord, content_hash
from gateway.configuration.loading import to_toml, validate
from gateway.configuration.model import Configuration
from gateway.messages import NO_SESSION, ClockOffset
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.pipeline.incidents import IncidentRegister
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker, MessageTime, OutgoingMessage, encode_message
from gateway.pipeline.pipeline import Pipeline
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS, SleeplessClock

BOOT_ID = "b00t"
CLOCK = ClockState("synchronised", 250_000_000)
SECOND_NS = 1_000_000_000


@dataclass
class RecordedCrane:
    """A crane whose samples are recorded second by second."""

    folder: Path
    segment_s: float = 20.0
    settings: Mapping[str, Any] | None = None
    device: SimulatedCrane = field(
        default_factory=lambda: SimulatedCrane(
            odr_hz=100, block_samples=10, length_m=12.0, position_m=9.0, clock=SleeplessClock()
        )
    )
    chain: SegmentChain | None = None
    boot_id: str = BOOT_ID
    start_ns: int = START_NS

    def __post_init__(self) -> None:
        self.configuration: Configuration = validate(
            {
                "device": {"odr_hz": 100},
                "rope": {"length_m": 12.0},
                "housing": {"position_m": 9.0},
                "alerts": {"trip_deg": 4.0, "warn_deg": 3.0, "clear_deg": 2.0},
                **(self.settings or {}),
            },
            "test",
        )
        self.info: DeviceInfo = self.device.open()
        section = self.configuration.gateway
        header = RecordingHeader(
            __version__, section.site, section.crane, section.sensor, self.boot_id, to_toml(self.configuration)
        )
        self.recorder = Recorder(
            self.folder, header, segment_s=self.segment_s, fsync_s=1.0, quota_mb=1000.0, chain=self.chain
        )
        self.headers = HeaderMaker()
        self.incidents = IncidentRegister(self.boot_id)
        self.pipeline = self.make_pipeline()
        self.recorder.set_device(self.info, self.start_ns)
        self.recorder.start(self.start_ns)
        self.next_second_ns = self.newest_ns = self.start_ns

    def make_pipeline(self) -> Pipeline:
        correction = correction_for(self.info, self.configuration.device.axes, None)
        drift = self.new_drift(correction)
        return Pipeline(self.configuration, self.info, correction, self.headers, drift, self.incidents)

    def new_drift(self, correction: Correction) -> DriftMonitor:
        return DriftMonitor(None if correction.record is None else RestDriftMonitor(correction))

    def record(self, seconds: float) -> None:
        """Record so many seconds; clock messages come once a second."""
        count = 0
        while count < seconds * self.info.odr_hz:
            block = self.device.read()
            if not isinstance(block, SampleBlock):
                continue
            count += len(block)
            self.process(block)

    def process(self, block: SampleBlock) -> None:
        """Record a block and what follows from it."""
        for message in self.pipeline.process(block, CLOCK).messages:
            self.write(message)
        now_ns = self.newest_ns = int(block.time_ns[-1])
        if now_ns >= self.next_second_ns:
            self.next_second_ns = now_ns + SECOND_NS
            for message in self.second_messages(MessageTime(now_ns, CLOCK)):
                self.write(message)
        self.recorder.tick(now_ns)

    def second_messages(self, now: MessageTime) -> Iterator[OutgoingMessage]:
        """Yield the messages that come once a second."""
        clock = ClockOffset(
            **self.headers.make("clock", now, None),
            log_time_ns=now.log_time_ns,
            wall_offset_ns=CLOCK.wall_offset_ns,
            stepped=False,
        )
        yield OutgoingMessage("clock", now.log_time_ns, clock)

    def write(self, message: OutgoingMessage) -> None:
        self.recorder.write(encode_message(message.topic, message.message, message.log_time_ns))

    def close(self) -> Path:
        """End the recording; return its folder."""
        self.recorder.close()
        return self.folder


def recalibrated(crane: RecordedCrane) -> None:
    """Recalibrate as the gateway does: the suspension of the alerts and the commit begin a new pipeline each."""
    crane.record(12)
    collecting = replace(NO_SESSION, id="r-1", phase="collecting", method="six_position", by="ann", suspended=True)
    begin_pipeline(crane, correction_for(crane.info, crane.configuration.device.axes, None))
    for number in range(6):
        crane.pipeline.set_session(replace(collecting, text=f"pose {number}"))
        announce(crane)
        crane.record(0.5)
    record = new_record(crane)
    begin_pipeline(crane, correction_for(crane.info, crane.configuration.device.axes, record))
    crane.pipeline.set_session(replace(NO_SESSION, id="r-1", phase="committed", text="committed"))
    announce(crane)
    crane.record(15)
    crane.close()


def begin_pipeline(crane: RecordedCrane, correction: Correction) -> None:
    drift = crane.new_drift(correction)
    crane.pipeline = Pipeline(crane.configuration, crane.info, correction, crane.headers, drift, crane.incidents)


def announce(crane: RecordedCrane) -> None:
    crane.write(crane.pipeline.calibration_message(MessageTime(crane.newest_ns, CLOCK)))


def new_record(crane: RecordedCrane) -> CalibrationRecord:
    content = {**(crane.info.factory_calibration or {}), "id": "site-2", "method": "six_position"}
    content["offset"] = [value + 100.0 for value in content["offset"]]
    return CalibrationRecord.model_validate({**content, "sha256": content_hash(content)})
