"""The processing thread among the parts of a gateway: what it sends while something in it hangs."""

import threading
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from devices.host_clock import HostClock
from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import CalibrationStore, find_record_in_force
from gateway.configuration.loading import validate
from gateway.daemon.commands.configuration_service import ConfigurationService
from gateway.daemon.parts import Parts, compose
from gateway.daemon.processor import HEALTH_PERIOD_S
from gateway.daemon.runtime.logs import LineWriter
from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.storage import calibration_provider
from gateway.messages import Health
from gateway.pki.site_folder import Holder
from gateway.recording.chain.segment_chain import SegmentChain
from tests.gateway.conftest import record_content
from tests.gateway.pki.site import Site
from tests.values import present
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

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


def composed(folder: Path, device: HangingDevice, bus: Mapping[str, Any] | None = None) -> Parts:
    gateway, page = {"data_dir": str(folder)}, {"enabled": False}
    configuration = validate({"gateway": gateway, "page": page, "bus": bus or {}}, "test")
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


def test_a_device_whose_record_the_disk_does_not_give_is_uncalibrated_until_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other, device, gate = replace(INFO, device_id="part-8"), HangingDevice(), threading.Event()
    made = CalibrationRecord.model_validate(
        record_content(device_id="part-8", unit="g", correction_matrix=np.eye(3).tolist())
    )
    store = CalibrationStore(tmp_path, "part-8")
    store.add(made)
    store.put_in_force(made.id, by="ann", reason="", request="request-1", time_utc="2026-01-01T00:00:00Z")
    device.gate.set()
    parts = composed(tmp_path, device)
    parts.outbox.start()
    parts.processor.start()

    def hang(data_dir: Path, device_id: str) -> CalibrationRecord | None:
        gate.wait(PATIENCE_S)
        return find_record_in_force(data_dir, device_id)

    monkeypatch.setattr(calibration_provider, "find_record_in_force", hang)
    parts.sampler.blocks.put(other)
    wait_until(lambda: parts.processor.info == other, "the other device")
    assert present(parts.processor.correction).status == "uncalibrated"
    gate.set()
    wait_until(lambda: present(parts.processor.correction).calibration_id == made.id, "its record")
    for worker in (parts.processor, parts.outbox, parts.commands):
        worker.finish()
        worker.join(PATIENCE_S)


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
    for worker in (parts.outbox, parts.commands):
        worker.finish()
        worker.join(PATIENCE_S)


def test_health_states_the_days_of_a_certificate_that_the_processor_does_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, device, read = Site(tmp_path / "keys").issue("crane-1", Holder.GATEWAY, days=100), HangingDevice(), set()
    read_bytes = Path.read_bytes

    def note(path: Path) -> bytes:
        if path.suffix == ".pem":
            read.add(threading.current_thread().name)
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", note)
    device.gate.set()
    files = {"ca": "ca.pem", "certificate": "certificate.pem", "key": "key.pem"}
    parts = composed(tmp_path, device, {"tls": {key: str(folder / name) for key, name in files.items()}})
    parts.outbox.start()
    parts.processor.start()

    def is_stated() -> bool:
        sent = parts.publisher.inbox.get(0.0)
        return sent is not None and isinstance(sent.message, Health) and sent.message.certificate_days_left in (99, 100)

    wait_until(is_stated, "the days that are left")
    assert read == {"commands"}
    for worker in (parts.processor, parts.outbox, parts.commands):
        worker.finish()
        worker.join(PATIENCE_S)
