"""Time and memory of `plumbline record info` on a day at 100 Hz: 86 400 s in segments of 10 minutes."""

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from devices.block import SampleBlock
from devices.simulated.device import SimulatedCrane
from gateway import __version__, messages
from gateway.calibration.correction import correction_for
from gateway.configuration.loading import to_toml, validate
from gateway.pipeline.outgoing_message import HeaderMaker, OutgoingMessage, encode_message
from gateway.pipeline.pipeline import Pipeline
from gateway.recording.format.content import RecordingHeader
from gateway.recording.segments.recorder import Recorder
from tests.benchmarks.chain import CLOCK
from tests.clocks import SleeplessClock

RATE_HZ = 100
BLOCK = 10
MINUTE_S = 60
DAY_S = 86_400


def main(options: list[str] | None = None) -> None:
    """Print a row per command; the one option is the number of seconds to record in place of a day."""
    recorded_s = int(options[0]) if options else DAY_S
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_recordings(folder, recorded_s)
        files = sorted(folder.glob("*.mcap"))
        size_mb = sum(file.stat().st_size for file in files) / 1e6
        print(f"record info: {recorded_s} s at {RATE_HZ} Hz, {len(files)} files, {size_mb:.0f} MB")
        report("with summaries", folder)
        report("last minute", folder, "--last", "60")


def report(label: str, folder: Path, *options: str) -> None:
    """Print time and memory of one command."""
    begin_s, before_s = time.monotonic(), children_cpu_s()
    command = [sys.executable, "-m", "gateway", "record", "info", str(folder), *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    used_s = time.monotonic() - begin_s
    resident_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"  {label:<16}{used_s:8.2f} s, CPU {children_cpu_s() - before_s:.2f} s, at most {resident_mb:.0f} MiB")


def children_cpu_s() -> float:
    """CPU of the commands so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def write_recordings(folder: Path, recorded_s: int) -> None:
    """Write a minute of the simulated crane over and over, with the times moved."""
    configuration = validate({"device": {"odr_hz": RATE_HZ}}, "benchmark")
    clock = SleeplessClock()
    device = SimulatedCrane(odr_hz=RATE_HZ, block_samples=BLOCK, length_m=12.0, position_m=9.0, clock=clock)
    info = device.open()
    pipeline = Pipeline(configuration, info, correction_for(info, configuration.device.axes, None), HeaderMaker())
    minute: list[OutgoingMessage] = []
    for _ in range(MINUTE_S * RATE_HZ // BLOCK):
        block = device.read()
        assert isinstance(block, SampleBlock)
        minute += pipeline.process(block, CLOCK).messages
    header = RecordingHeader(__version__, "site", "crane", "hook", "boot", to_toml(configuration))
    recorder = Recorder(folder, header, segment_s=600.0, fsync_s=1.0, quota_mb=16000)
    start_ns = minute[0].log_time_ns
    recorder.set_device(info, start_ns)
    recorder.start(start_ns)
    for number in range(recorded_s // MINUTE_S):
        for message in minute:
            content, log_time_ns = moved(message, number)
            recorder.write(encode_message(message.topic, content, log_time_ns))
            recorder.tick(log_time_ns)
    recorder.close()


def moved(message: OutgoingMessage, number: int) -> tuple[messages.Message | messages.Log, int]:
    """Return a message of the minute with this number, and its gateway time."""
    delay_ns = number * MINUTE_S * 10**9
    content, log_time_ns = message.message, message.log_time_ns + delay_ns
    if isinstance(content, messages.Samples):
        return replace(
            content, time_ns=log_time_ns, first_log_time_ns=content.first_log_time_ns + delay_ns
        ), log_time_ns
    if isinstance(content, messages.Message):
        return replace(content, time_ns=log_time_ns), log_time_ns
    return content, log_time_ns
