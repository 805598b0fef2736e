"""One part on a bus: what goes over the wire, what is tried again, and what a failure says."""

import ctypes
import errno
from typing import Any

import pytest

from devices.errors import (
    ConfigurationReadBackError,
    DeviceAccessError,
    DeviceError,
    DeviceNotFoundError,
    TransferError,
)
from devices.i2c.bus import MAX_ATTEMPTS, I2cPart
from tests.devices.i2c.i2c_chip import FakeClock

ADDRESS = 0x1D


class ScriptedBus:
    """Answers `i2c_rdwr` from a list: bytes to hand out (none for a write) or an errno; notes what was asked."""

    def __init__(self, clock: FakeClock, *answers: Any) -> None:
        self.clock = clock
        self.answers = list(answers)
        self.asked: list[list[tuple[int, int, bytes]]] = []
        self.closed = 0

    def i2c_rdwr(self, *messages: Any) -> None:
        self.asked.append([(message.addr, message.flags, bytes(message)) for message in messages])
        answer = self.answers.pop(0)
        if isinstance(answer, int):
            self.clock.pass_s(1.0 if answer == errno.ETIMEDOUT else 0.0001)
            raise OSError(answer, "scripted")
        if answer:
            ctypes.memmove(messages[-1].buf, answer, messages[-1].len)

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


def opened(clock: FakeClock, *answers: Any) -> tuple[I2cPart, ScriptedBus]:
    bus = ScriptedBus(clock, *answers)
    part = I2cPart(1, ADDRESS, clock, lambda number: bus)
    part.open()
    return part, bus


def test_a_read_is_one_transaction_of_any_length(clock: FakeClock) -> None:
    data = bytes(range(256)) + bytes(32)
    part, bus = opened(clock, data)
    assert part.read(0x11, 288) == data
    assert bus.asked == [[(ADDRESS, 0, b"\x11"), (ADDRESS, 1, bytes(288))]]


def test_a_write_is_register_and_value(clock: FakeClock) -> None:
    part, bus = opened(clock, b"")
    part.write(0x2D, 0x01)
    assert bus.asked == [[(ADDRESS, 0, b"\x2d\x01")]]


def test_a_register_that_does_not_keep_its_value_is_named(clock: FakeClock) -> None:
    part, _ = opened(clock, b"", b"\x82", b"", b"\x81")
    part.write_checked(0x2C, 0x82, "RANGE")
    with pytest.raises(
        ConfigurationReadBackError, match=r"^I2C bus 1 address 0x1d: register RANGE \(0x2c\) reads 0x81 after 0x82"
    ):
        part.write_checked(0x2C, 0x82, "RANGE")


def test_a_transfer_that_fails_twice_is_repeated_and_counted(clock: FakeClock) -> None:
    part, bus = opened(clock, errno.EREMOTEIO, errno.EAGAIN, b"\xad")
    assert part.read(0x00, 1) == b"\xad"
    assert len(bus.asked) == MAX_ATTEMPTS
    assert part.faults == {"i2c_no_acknowledge": 1, "i2c_bus_error": 1}


@pytest.mark.parametrize(
    ("number", "name", "words"),
    [
        (errno.EREMOTEIO, "i2c_no_acknowledge", "no acknowledge; check wiring, supply and address"),
        (errno.ENXIO, "i2c_no_acknowledge", "no acknowledge"),
        (errno.EIO, "i2c_bus_error", "bus error; shorten the cable"),
        (errno.EAGAIN, "i2c_bus_error", "the bus is taken"),
        (errno.ENODEV, "i2c_bus_error", "the transfer failed"),
    ],
)
def test_a_persistent_transfer_error_is_raised(clock: FakeClock, number: int, name: str, words: str) -> None:
    part, bus = opened(clock, *[number] * 10)
    with pytest.raises(TransferError, match=f"^I2C bus 1 address 0x1d: {words}") as caught:
        part.read(0x00, 1)
    assert "\n" not in str(caught.value)
    assert f"errno {number}" in str(caught.value)
    assert len(bus.asked) == MAX_ATTEMPTS
    assert part.faults == {name: MAX_ATTEMPTS}


def test_a_timeout_of_the_kernel_is_not_repeated(clock: FakeClock) -> None:
    part, bus = opened(clock, *[errno.ETIMEDOUT] * 10)
    with pytest.raises(TransferError, match="a part holds the bus"):
        part.read(0x00, 1)
    assert len(bus.asked) == 1


def test_a_consuming_read_is_repeated_only_if_nothing_was_removed(clock: FakeClock) -> None:
    part, bus = opened(clock, errno.EREMOTEIO, b"\1\2\3")
    assert part.read(0x11, 3, consuming=True) == b"\1\2\3"
    part, bus = opened(clock, errno.EIO, b"\1\2\3")
    with pytest.raises(TransferError):
        part.read(0x11, 3, consuming=True)
    assert len(bus.asked) == 1


def test_a_missing_bus_is_reported_with_the_remedy(clock: FakeClock) -> None:
    with pytest.raises(DeviceNotFoundError, match=r"^/dev/i2c-250: no such bus; enable I2C \(raspi-config"):
        I2cPart(250, ADDRESS, clock).open()  # the real opener


@pytest.mark.parametrize(
    ("error", "raised", "words"),
    [
        (PermissionError(errno.EACCES, "denied"), DeviceAccessError, "^/dev/i2c-1: .* group i2c"),
        (OSError(errno.ENOTTY, "not a tty"), DeviceError, "^/dev/i2c-1: does not open as an I2C bus"),
    ],
)
def test_a_bus_that_does_not_open_is_reported_with_the_remedy(
    clock: FakeClock, error: OSError | PermissionError, raised: type[DeviceAccessError] | type[DeviceError], words: str
) -> None:
    def refuse(number: int) -> ScriptedBus:
        raise error

    with pytest.raises(raised, match=words):
        I2cPart(1, ADDRESS, clock, refuse).open()


@pytest.mark.parametrize("address", [-1, 0x07, 0x78, 0x11D])
def test_an_impossible_address_is_refused(clock: FakeClock, address: int) -> None:
    with pytest.raises(ValueError, match="0x08 to 0x77"):
        I2cPart(1, address, clock)


def test_closing_twice_and_reading_afterwards(clock: FakeClock) -> None:
    part, bus = opened(clock)
    part.close()
    part.close()
    assert bus.closed == 1
    with pytest.raises(TransferError, match="not open"):
        part.read(0x00, 1)


def test_reopening_releases_the_bus(clock: FakeClock) -> None:
    part, bus = opened(clock)
    part.open()
    assert bus.closed == 1
