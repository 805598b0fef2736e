"""The checks of `plumbline doctor`: everything that `run` needs, one result for each."""

import os
import pwd
import shutil
import sys
from collections.abc import Iterator
from getpass import getuser
from pathlib import Path

from devices.errors import DeviceError
from devices.host_clock import HostClock
from gateway.bus.session import open_gateway_session
from gateway.calibration.correction import correction_for
from gateway.calibration.store import find_record_in_force
from gateway.configuration.bus_section import is_loopback
from gateway.configuration.device_sections import I2cSection
from gateway.configuration.model import Configuration
from gateway.configuration.relay_section import GpioRelay, NoRelay
from gateway.daemon.doctor import CheckResult
from gateway.daemon.doctor.device_check import check_attitude, examine_device, read_blocks
from gateway.daemon.doctor.service_check import examine_running
from gateway.daemon.runtime.host import WallClockMonitor, disk_free_mb
from gateway.daemon.runtime.instance import is_in_use
from gateway.daemon.sampling.device_factory import make_device
from gateway.daemon.storage.recording_worker import signing_key_path
from gateway.errors import PlumblineError
from gateway.extras import what_is_missing
from gateway.page.channel import listen_at
from gateway.pki.signing_key import KeyFileError, fingerprint
from gateway.recording.chain.chain_state import STATE_NAME, ChainStateError, list_aside, read_state
from gateway.recording.chain.segment_chain import newest_signed
from gateway.recording.chain.statements import is_forged

LOW_DISK_MB = 500.0
"""Least free space without a warning. Basis: a choice; some hours of a recording, and a small share of any card."""
ATTITUDE_S = 0.5
"""Time for which the sensor is read to say which face is up. Basis: a choice; tens of samples, and no wait for a person."""


def examine(configuration: Configuration) -> Iterator[CheckResult]:
    """Check everything that `run` needs; yields each result at once. A gateway that runs is asked how it does instead."""
    version = ".".join(map(str, sys.version_info[:3]))
    yield CheckResult("good" if sys.version_info >= (3, 11) else "bad", "python", version)
    if is_in_use(configuration.gateway.data_dir):
        yield from examine_running(configuration)
        checks = [_disk, _chain, check_signing_key, _clock, _housing]
    else:
        yield CheckResult("note", "gateway", f"none runs with {configuration.gateway.data_dir}", {"runs": False})
        opening = [_device, _bus, _page, check_relay] if user_to_be(configuration) is None else [_not_opened]
        checks = [_data_folder, _chain, check_signing_key, *opening, _clock, _housing]
    for check in checks:
        yield from check(configuration)


def user_to_be(configuration: Configuration) -> str | None:
    """Return whom a check must run as that opens what the settings name; None: the present user may.

    The service may write its own settings: root would open any file, device or socket that they name, and a local socket of the
    bus takes the place of a file.
    """
    try:
        owner = configuration.gateway.data_dir.stat().st_uid
    except OSError:
        return None
    if os.geteuid() != 0 or owner == 0:
        return None
    try:
        return pwd.getpwuid(owner).pw_name
    except KeyError:
        return f"#{owner}"


def _not_opened(configuration: Configuration) -> Iterator[CheckResult]:
    user = user_to_be(configuration)
    yield CheckResult(
        "note", "user", f"root opens neither sensor nor bus for {user}; run: sudo -u {user} plumbline doctor"
    )


def examine_sensor_as_user(configuration: Configuration) -> Iterator[CheckResult]:
    """Examine the sensor alone, unless root would open it for another user."""
    if (user := user_to_be(configuration)) is None:
        yield from examine_sensor(configuration)
    else:
        text = f"root does not open the sensor for {user}; run: sudo -u {user} plumbline doctor --device"
        yield CheckResult("bad", "device", text)


def examine_sensor(configuration: Configuration) -> Iterator[CheckResult]:
    """Examine the sensor alone, which no gateway may use meanwhile; yields each result at once."""
    if is_in_use(configuration.gateway.data_dir):
        yield CheckResult("bad", "device", "a gateway is using the sensor; stop it first (systemctl stop plumbline)")
        return
    yield from examine_device(configuration, make_device, HostClock())


def _data_folder(configuration: Configuration) -> Iterator[CheckResult]:
    folder = configuration.gateway.data_dir
    if not folder.exists():
        parent = next(above for above in folder.absolute().parents if above.exists())
        if os.access(parent, os.W_OK):
            yield CheckResult("good", "data", f"{folder}: is made at the first start")
        else:
            yield CheckResult("bad", "data", f"{folder}: cannot be made in {parent}; choose another gateway.data_dir")
        return
    if not os.access(folder, os.W_OK | os.X_OK):
        yield CheckResult("bad", "data", f"{folder}: {getuser()} may not write there; run as the gateway's user")
        return
    yield from _disk(configuration)


def _disk(configuration: Configuration) -> Iterator[CheckResult]:
    folder = configuration.gateway.data_dir
    free_mb = disk_free_mb(folder) or 0.0
    enough = free_mb > LOW_DISK_MB
    quota = configuration.recorder.quota_mb
    yield CheckResult("good" if enough else "bad", "data", f"{folder}: {free_mb:.0f} MB free")
    if free_mb < quota:
        yield CheckResult(
            "note", "data", f"recorder.quota_mb {quota:g} exceeds the free space; recording stops when the disk is full"
        )


def _chain(configuration: Configuration) -> Iterator[CheckResult]:
    folder = configuration.gateway.data_dir
    if problem := _problem_of_state(folder):
        remedy = "the next start keeps it aside, goes on from the recordings, and says what it lost"
        yield CheckResult("bad", "chain", f"{problem}; {remedy}")
    if kept := list_aside(folder):
        names = ", ".join(path.name for path in kept)
        yield CheckResult(
            "note",
            "chain",
            f"{folder}: has {names}, kept from damage; copy them for an investigation, then delete them",
        )


def _problem_of_state(folder: Path) -> str:
    try:
        state, newest = read_state(folder), newest_signed(folder)
        differs = state is not None and newest is not None and is_forged(state, [newest], newest.public_key)
    except ChainStateError as error:
        return str(error)
    except KeyFileError:  # without the extra no signature can be checked
        return ""
    return f"{folder / STATE_NAME}: is not signed with the key of the newest recording" if differs else ""


def check_signing_key(configuration: Configuration) -> Iterator[CheckResult]:
    """Check that the key is there with which the recordings are signed."""
    path = signing_key_path(configuration)
    if not path.exists() and (before := newest_signed(configuration.gateway.data_dir)):
        signer = fingerprint(before.public_key)
        text = f"{path}: is missing, and the recordings are signed with {signer}; restore it from its backup before "
        yield CheckResult("bad", "signing", text + "the next start, which makes another")


def _device(configuration: Configuration) -> Iterator[CheckResult]:
    if isinstance(configuration.device, I2cSection) and not list(Path("/dev").glob("i2c-*")):
        yield CheckResult("bad", "device", "this machine has no I2C bus; on a Pi: raspi-config, Interface Options, I2C")
    try:
        device = make_device(configuration, HostClock())
        info = device.open()
        try:
            blocks = [] if info.can_wait else read_blocks(device, HostClock(), ATTITUDE_S)
        finally:
            device.close()
    except DeviceError as error:
        yield CheckResult("bad", "device", str(error))
        return
    yield CheckResult("good", "device", f"{info.kind} {info.device_id} at {info.odr_hz:g} Hz")
    if blocks:
        attitude = check_attitude(info, configuration.device.axes, blocks)
        yield from (result for result in attitude if result.grade != "bad")  # the crane may be working
    try:
        stored = find_record_in_force(configuration.gateway.data_dir, info.device_id)
        correction = correction_for(info, configuration.device.axes, stored)
    except PlumblineError as error:
        yield CheckResult("bad", "calibration", str(error))
        return
    yield CheckResult("note" if correction.status == "uncalibrated" else "good", "calibration", correction.text)


def _bus(configuration: Configuration) -> Iterator[CheckResult]:
    bus = configuration.bus
    try:
        open_gateway_session(bus, configuration.gateway.key).close()
    except PlumblineError as error:
        yield CheckResult("bad", "bus", str(error))
        return
    yield CheckResult(
        "good", "bus", f"{configuration.gateway.key} at {', '.join([*bus.active_listeners, *bus.connect])}"
    )
    exposed = [endpoint for endpoint in bus.active_listeners if not is_loopback(endpoint)]
    if exposed:
        yield CheckResult("note", "bus", f"{', '.join(exposed)}: reachable from the network")


def _page(configuration: Configuration) -> Iterator[CheckResult]:
    if not configuration.page.enabled:
        yield CheckResult("note", "page", "off (page.enabled = false)")
        return
    if (missing := what_is_missing("page")) is not None:
        yield CheckResult("bad", "page", missing)
        return
    try:
        listen_at(*configuration.page.address).close()
    except OSError as error:
        yield CheckResult("bad", "page", f"{configuration.page.listen}: {error.strerror}; choose another page.listen")
        return
    yield CheckResult("good", "page", f"http://{configuration.page.listen}/")


def _clock(_configuration: Configuration) -> Iterator[CheckResult]:
    quality = WallClockMonitor(HostClock()).poll().quality
    if quality == "synchronised":
        yield CheckResult("good", "clock", "synchronised")
    else:
        yield CheckResult("note", "clock", "not synchronised; sample times are consistent, but their UTC may be wrong")


def _housing(configuration: Configuration) -> Iterator[CheckResult]:
    position_m = configuration.housing_position_m
    if position_m is None:
        text = "[housing] position_m or above_load_m is not given; without it there is no swing estimate"
        yield CheckResult("bad", "housing", text)
        return
    length_m = configuration.rope.length_m
    yield CheckResult(
        "good", "housing", f"{position_m:g} m of {length_m:g} m from the pivot (rho {position_m / length_m:.2f})"
    )


def check_relay(configuration: Configuration) -> Iterator[CheckResult]:
    """Check that the configured output can be used."""
    relay = configuration.relay
    if isinstance(relay, NoRelay):
        return
    if isinstance(relay, GpioRelay):
        yield _check_gpio(relay)
    elif shutil.which(relay.command[0]) is None:
        yield CheckResult(
            "bad", "relay", f"{relay.command[0]}: no such program, or not executable; correct relay.command"
        )
    else:
        yield CheckResult("good", "relay", f"{relay.command[0]} can be run; it was not called")


def _check_gpio(relay: GpioRelay) -> CheckResult:
    if (missing := what_is_missing("relay")) is not None:
        return CheckResult("bad", "relay", missing)
    if not relay.chip.exists():
        return CheckResult(
            "bad", "relay", f"{relay.chip}: no such GPIO chip; correct relay.chip (gpiodetect lists them)"
        )
    if not os.access(relay.chip, os.R_OK | os.W_OK):
        return CheckResult(
            "bad",
            "relay",
            f"{relay.chip}: no permission; add the user to the group gpio (docs/guides/service/relay.md)",
        )
    return CheckResult("good", "relay", f"{relay.chip}, line {relay.line}: can be opened; the line was not switched")
