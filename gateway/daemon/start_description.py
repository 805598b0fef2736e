"""What was started, as text for the person who started the gateway."""

from pathlib import Path

from devices.block import DeviceInfo
from gateway import __version__
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.daemon.runtime.faults import FaultRegister
from gateway.page.pin import PIN_NAME


def describe(
    configuration: Configuration,
    info: DeviceInfo | None,
    correction: Correction | None,
    recording: Path | None,
    signed: str,
    faults: FaultRegister,
) -> str:
    """Return the addresses of page, recording, bus and log, or the fault of what does not work."""
    bus = ", ".join([*configuration.bus.listen, *configuration.bus.connect]) or "no endpoint"
    places = {
        "page": f"http://{configuration.page.listen}/" if configuration.page.enabled else "off (page.enabled)",
        "PIN": f"{configuration.gateway.data_dir / PIN_NAME}, to acknowledge alarms on the page",
        "recording": str(recording),
        "signed": signed,
        "bus": f"{configuration.gateway.key}/** at {bus}",
        "log": "standard error, and /log in the recording",
    }
    if not configuration.page.enabled:
        del places["PIN"]
    standing = faults.standing
    lines = [
        f"  {place:<10} {f'FAULT: {standing[place]}' if place in standing else text}" for place, text in places.items()
    ]
    if info is None or correction is None:
        head = f"plumbline {__version__}: FAULT: {standing.get('device', 'the device is not open yet')}"
    else:
        head = (
            f"plumbline {__version__}: {info.kind} {info.device_id}, {info.odr_hz:g} Hz; calibration {correction.text}"
        )
    return "\n".join((head, *lines))
