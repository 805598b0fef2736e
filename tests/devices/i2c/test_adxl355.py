"""The driver against a model of the chip at the bus: opening and steady reading; nothing of the driver is replaced."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from devices.errors import DeviceError, IdentityError, TransferError
from devices.i2c.adxl355 import noise_g, temperature_c
from tests.devices.i2c.adxl355_rig import POWER_CTL, RANGE, STATUS, Rig, telling_time

# Opening


def test_open_identifies_resets_configures_reads_back_and_starts_the_part(rig: Callable[..., Rig]) -> None:
    made = rig(odr_hz=1000.0, range_g=4, block_samples=16)
    made.open()
    exchange = [
        (kind, register, detail) for kind, register, detail in made.chip.log if (kind, register) != ("read", STATUS)
    ]
    assert exchange == [
        ("read", 0x00, 3),
        ("read", 0x03, 1),
        ("write", 0x2F, 0x52),
        *[("write", POWER_CTL, 0x01), ("read", POWER_CTL, 1)],
        *[("write", RANGE, 0x82), ("read", RANGE, 1)],
        *[("write", 0x28, 0x02), ("read", 0x28, 1)],
        *[("write", 0x2E, 0x00), ("read", 0x2E, 1)],
        *[("write", POWER_CTL, 0x00), ("read", POWER_CTL, 1)],
    ]
    assert made.opened_bus == 1


def test_device_info_states_the_revision_and_the_data_sheet(rig: Callable[..., Rig]) -> None:
    info = rig(revision=0x07).open()
    assert info.device_id == "adxl355-07-i2c1-1d"
    assert info.zero_g_offset_g == 0.075
    assert info.bandwidth_hz == info.odr_hz / 4
    assert info.noise_g == noise_g(125.0)


def test_a_label_is_the_identity_of_the_device(rig: Callable[..., Rig]) -> None:
    assert rig(serial="hoist-2").open().device_id == "adxl355-hoist-2"


def test_noise_is_between_that_of_an_ideal_and_a_first_order_filter() -> None:
    assert noise_g(4000) == pytest.approx(22.5e-6 * math.sqrt(1000 * math.pi / 2))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"odr_hz": 100.0}, "no output data rate of 100 Hz; it has 4000, 2000, 1000, 500, 250, 125, 62.5"),
        ({"range_g": 16}, "no range of 16 g; it has 2, 4 and 8"),
        ({"block_samples": 0}, "1 to 16"),
    ],
)
def test_rates_and_ranges_that_the_part_does_not_have_are_refused(
    rig: Callable[..., Rig], arguments: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        rig(**arguments)


def test_another_part_at_the_address_is_named(rig: Callable[..., Rig]) -> None:
    made = rig()
    made.chip.registers.update({0x00: 0xE5, 0x01: 0x00, 0x02: 0x00})
    with pytest.raises(
        IdentityError,
        match=r"^I2C bus 1 address 0x1d: identity reads E5 00 00, .*; this is an ADXL345",
    ):
        made.open()
    assert made.chip.closed


@pytest.mark.parametrize("refuses", [False, True])
def test_open_waits_for_a_slow_reset(rig: Callable[..., Rig], refuses: bool) -> None:
    made = rig(busy_s=0.1, refuses_while_busy=refuses)
    made.open()
    assert made.read_s(1)


def test_open_fails_if_the_reset_does_not_end(rig: Callable[..., Rig]) -> None:
    made = rig(busy_s=10)
    with pytest.raises(TransferError, match=r"still busy 0\.2 s after reset; power-cycle"):
        made.open()
    assert made.clock.elapsed_s < 1


# Steady reading


@pytest.mark.slow
@pytest.mark.parametrize(
    ("odr_hz", "block_samples", "seconds"), [(125.0, 7, 60), (1000.0, 32, 20), (4000.0, 32, 5), (3.90625, 8, 60)]
)
def test_every_sample_is_read_once_and_in_order(
    rig: Callable[..., Rig], odr_hz: float, block_samples: int, seconds: int
) -> None:
    made = rig(odr_hz=odr_hz, block_samples=block_samples, rate_error=0.03, signal=telling_time)
    made.open()
    made.read_s(seconds)
    assert (made.lost, sum(made.device.faults.values())) == (0, 0)
    made_ns = np.array(made.chip.made_ns)[: made.samples]
    assert made.samples >= len(made.chip.made_ns) - 32
    assert np.allclose(made.made_at_s(), (made_ns - made.start_ns) / 1e9, atol=5e-6)
    assert np.all(np.diff(made.time_ns) > 0)
    if odr_hz >= 125:
        assert np.mean([len(block) for block in made.blocks]) == pytest.approx(min(block_samples, 16), rel=0.1)


@pytest.mark.parametrize("rate_error", [-0.05, 0.05])
def test_the_moment_of_sampling_is_found_within_two_seconds(rig: Callable[..., Rig], rate_error: float) -> None:
    made = rig(rate_error=rate_error, signal=telling_time)
    made.open()
    made.read_s(4)
    assert np.abs(made.error_ms()[made.made_at_s() > 2]).max() < 1


def test_a_read_never_waits_much_longer_than_half_a_second(rig: Callable[..., Rig]) -> None:
    made = rig(odr_hz=3.90625, block_samples=16)
    made.open()
    waits = []
    for _ in range(20):
        start_s = made.clock.elapsed_s
        made.device.read()
        waits.append(made.clock.elapsed_s - start_s)
    assert max(waits) < 0.51


def test_blocks_contain_the_temperature(rig: Callable[..., Rig]) -> None:
    made = rig()
    made.chip.temperature_raw = 1885 - 181
    made.open()
    made.read_s(1)
    assert {block.temperature_c for block in made.blocks} == {temperature_c(1885 - 181)}


def test_temperature_that_changes_while_it_is_read_is_read_again(rig: Callable[..., Rig]) -> None:
    made = rig()
    made.chip.temperature_raw = 0x6FF
    made.chip.temperature_steps = [0x6FF, 0x700, 0x700]  # high byte of one, low byte of the other
    made.open()
    made.read_s(0.5)
    assert made.blocks[0].temperature_c == temperature_c(0x6FF)


def test_a_temperature_that_never_settles_is_omitted(rig: Callable[..., Rig]) -> None:
    made = rig()
    made.chip.temperature_steps = [raw << 8 for raw in range(1, 13)]
    made.open()
    made.read_s(0.5)
    assert made.blocks[0].temperature_c is None


@pytest.mark.slow
def test_a_closed_device_can_be_opened_again(rig: Callable[..., Rig]) -> None:
    made = rig(signal=telling_time)
    made.open()
    made.read_s(5)
    made.device.close()
    made.device.close()
    made.clock.pass_s(10)
    with pytest.raises(DeviceError):
        made.device.read()
    made.open()
    made.read_s(5)
    assert np.all(np.diff(made.time_ns) > 0)
    assert np.abs(made.error_ms()).max() < 10
    assert made.lost == 0
