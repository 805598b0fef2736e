"""A crane whose trolley starts hastily, recorded by the pipeline and the recorder in files of ten seconds."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from devices.simulated.crane import Crane
from devices.simulated.device import SimulatedCrane
from devices.simulated.schedule import TrolleyMove
from gateway.calibration.correction import correction_for
from gateway.calibration.record import CalibrationRecord
from gateway.configuration.loading import validate
from gateway.configuration.render import to_toml
from gateway.messages import Alert, ClockOffset, FoxgloveTime, Health, Log, Motion
from gateway.pipeline.incidents import IncidentRegister
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker, MessageTime, OutgoingMessage, encode_message
from gateway.pipeline.pipeline import Pipeline
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.signing_key import load_or_create_key
from gateway.recording.format.header import RecordingHeader
from gateway.recording.segments.calibration_files import calibration_files
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.recorder import Recorder
from tests.gateway.pipeline.test_pipeline import Clock

LENGTH_M, POSITION_M, RATE_HZ = 6.0, 4.0, 50.0
PERIOD_S = 2 * np.pi * np.sqrt(LENGTH_M / 9.80665)
START_S = 6.0
SEGMENT_S = 10.0
WALL_OFFSET_NS = 250_000_000
BOOT_ID = "b00t"
COMPACTED = 2
"""The first files are compacted, the others as they were written."""
LIMITS = {"warn_deg": 3.0, "trip_deg": 5.0, "clear_deg": 2.0, "hold_s": 2.0}


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
    def largest(self) -> Motion:
        found = [each.message for each in self.messages if isinstance(each.message, Motion)]
        return max((each for each in found if each.angle_deg is not None), key=lambda each: each.angle_deg or 0.0)


def record_crane(folder: Path, seconds: float = 45.0) -> RecordedCrane:
    """Record a trolley move that starts at START_S and whose swing dies down."""
    clock = Clock()
    move = TrolleyMove(START_S, PERIOD_S, PERIOD_S / 2, 0.55, 0.6, "Trolley starts hastily")
    crane = Crane(length_m=LENGTH_M, position_m=POSITION_M, gravity_m_s2=9.80665, events=[move], damping_ratio=0.05)
    device = SimulatedCrane(
        odr_hz=RATE_HZ, block_samples=5, length_m=LENGTH_M, position_m=POSITION_M, clock=clock, crane=crane
    )
    info = device.open()
    configuration = validate(
        {
            "device": {"odr_hz": RATE_HZ},
            "rope": {"length_m": LENGTH_M},
            "housing": {"position_m": POSITION_M},
            "alerts": LIMITS,
        },
        "test",
    )
    chain = SegmentChain(folder, "yard/crane-2/hook", load_or_create_key(folder / "signing-key.pem"))
    correction = correction_for(info, configuration.device.axes, None)
    headers = HeaderMaker()
    pipeline = Pipeline(configuration, info, correction, headers, incidents=IncidentRegister(BOOT_ID))
    recorder = Recorder(
        folder,
        RecordingHeader(
            software="0.1.0",
            site="yard",
            crane="crane-2",
            sensor="hook",
            boot_id=BOOT_ID,
            configuration_toml=to_toml(configuration),
        ),
        segment_s=SEGMENT_S,
        fsync_s=1.0,
        quota_mb=1000.0,
        chain=chain,
    )
    recorder.start(clock.now_ns())
    recorder.set_device(info, clock.now_ns())
    if correction.record is not None:
        record = CalibrationRecord.model_validate(correction.record)
        recorder.set_calibration(calibration_files(record, None), clock.now_ns())
    sent: list[OutgoingMessage] = []
    state, begin_ns, next_ns, samples = ClockState("synchronised", WALL_OFFSET_NS), clock.now_ns(), 0, 0
    while clock.now_ns() - begin_ns < seconds * 1e9:
        block = device.read()
        assert block is not None
        samples += len(block)
        now = MessageTime(int(block.time_ns[-1]), state)
        made = list(pipeline.process(block, state).messages)
        made += [
            _log_line(each.message.change, now)
            for each in made
            if isinstance(each.message, Alert) and each.message.change is not None
        ]
        if now.log_time_ns >= next_ns:
            next_ns = now.log_time_ns + 1_000_000_000
            made += _status(headers, now, samples)
        for each in made:
            recorder.write(encode_message(each.topic, each.message, each.log_time_ns))
        sent += made
        recorder.tick(now.log_time_ns)
    recorder.close()
    for path in recorder.take_uncompacted()[:COMPACTED]:
        compact(path, chain)
    return RecordedCrane(folder, sent)


def _log_line(text: str, now: MessageTime) -> OutgoingMessage:
    time = FoxgloveTime(sec=now.utc_ns // 10**9, nsec=now.utc_ns % 10**9)
    return OutgoingMessage("log", now.log_time_ns, Log(timestamp=time, level=3, message=text, name="plumbline.alert"))


def _status(headers: HeaderMaker, now: MessageTime, samples: int) -> Iterator[OutgoingMessage]:
    offset = ClockOffset(
        **headers.make("clock", now, None), log_time_ns=now.log_time_ns, wall_offset_ns=WALL_OFFSET_NS, stepped=False
    )
    yield OutgoingMessage("clock", now.log_time_ns, offset)
    health = Health(
        **headers.make("health", now, None),
        state="running",
        device_id="simulated-1",
        device_kind="simulated",
        boot_id=BOOT_ID,
        software="0.1.0",
        uptime_s=1.0,
        measured_rate_hz=RATE_HZ,
        samples=samples,
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
