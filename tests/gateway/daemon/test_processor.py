"""The processing thread among the parts of a gateway: what it sends while something in it hangs."""

import threading
import time
from collections.abc import Mapping
from pathlib import Path

from devices.block import DeviceInfo, SampleBlock
from devices.clock import HostClock
from gateway.configuration.loading import validate
from gateway.daemon.configuration_service import ConfigurationService
from gateway.daemon.faults import FaultRegister
from gateway.daemon.line_writer import LineWriter
from gateway.daemon.parts import Parts, compose
from gateway.daemon.processor import HEALTH_PERIOD_S
from gateway.messages import Health
from gateway.recording.chain import SegmentChain
from tests.waiting import PATIENCE_S

INFO = DeviceInfo(kind="test", device_id="part-7", unit="g", odr_hz=100.0, units_per_g=1.0)


class HangingDevice:
    """A device whose faults the processing thread waits for once."""

    def __init__(self) -> None:
        self.asked, self.gate = threading.Event(), threading.Event()

    def open(self) -> DeviceInfo:
        return INFO

    def read(self) -> SampleBlock | None:
        return None

    def close(self) -> None:
        pass

    @property
    def faults(self) -> Mapping[str, int]:
        if threading.current_thread().name == "processor":
            self.asked.set()
            self.gate.wait(PATIENCE_S)
        return {}


def composed(folder: Path, device: HangingDevice) -> Parts:
    configuration = validate({"gateway": {"data_dir": str(folder)}, "page": {"enabled": False}}, "test")
    return compose(
        configuration,
        device=device,
        info=INFO,
        clock=HostClock(),
        boot_id="0123456789ab",
        chain=SegmentChain(folder, configuration.gateway.key, None),
        claim_folder=lambda: None,
        output=LineWriter(2),
        changes=ConfigurationService(None, service=False, environment={}),
        faults=FaultRegister(),
    )


def test_health_keeps_its_order_when_the_processor_hangs_in_it_and_goes_on(tmp_path: Path) -> None:
    device = HangingDevice()
    parts = composed(tmp_path, device)
    parts.outbox.start()
    parts.processor.start()
    assert device.asked.wait(PATIENCE_S)
    time.sleep(1.1 * HEALTH_PERIOD_S)
    parts.processor.report_status()
    device.gate.set()
    parts.processor.finish()
    parts.processor.join(PATIENCE_S)
    sent = [parts.publisher.inbox.get(0.0) for _ in range(len(parts.publisher.inbox))]
    numbers = [each.message.sequence for each in sent if each is not None and isinstance(each.message, Health)]
    assert numbers == list(range(len(numbers)))
    for worker in (parts.outbox, parts.calibration_disk):
        worker.finish()
        worker.join(PATIENCE_S)
