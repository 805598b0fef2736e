"""The driver against a model of the chip at the bus: nothing of the driver is replaced."""

import errno
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.adxl355 import RATES_HZ, Adxl355, noise_g, temperature_c
from devices.adxl355_fifo import Run, decode_counts, split_entries
from devices.errors import ConfigurationReadBackError, DeviceError, IdentityError, TransferError

RANGE, POWER_CTL, FIFO_DATA, STATUS, LEVEL = 0x2C, 0x2D, 0x11, 0x04, 0x05
COUNTS = st.integers(-(1 << 19), (1 << 19) - 1)


class Rig:
    """A chip, a clock, and the driver on both."""

    def __init__(self, chips, *, oversleep_s=0.0001, odr_hz=125.0, range_g=2, block_samples=8, serial=None, **chip):
        self.start_ns = chips.START_NS
        self.clock = chips.FakeClock(oversleep_s)
        self.chip = chips.Adxl355Chip(self.clock, **chip)
        self.opened_bus = None
        self.device = Adxl355(
            1,
            0x1D,
            clock=self.clock,
            odr_hz=odr_hz,
            range_g=range_g,
            block_samples=block_samples,
            serial=serial,
            open_bus=self.open_bus,
        )
        self.blocks = []

    def open_bus(self, number):
        self.opened_bus = number
        self.chip.closed = False
        return self.chip

    def open(self):
        return self.device.open()

    def read_s(self, seconds):
        """Read for a while; the number of blocks."""
        until_s, before = self.clock.elapsed_s + seconds, len(self.blocks)
        while self.clock.elapsed_s < until_s:
            block = self.device.read()
            if block is not None:
                self.blocks.append(block)
        return len(self.blocks) - before

    @property
    def samples(self):
        return sum(len(block) for block in self.blocks)

    @property
    def lost(self):
        return sum(block.lost for block in self.blocks)

    @property
    def time_ns(self):
        return np.concatenate([block.time_ns for block in self.blocks])

    def made_at_s(self):
        """When each sample that came was made: it says so itself, see `telling_time`."""
        counts = np.concatenate([block.raw for block in self.blocks])
        return np.rint(counts[:, 0] / 256) + counts[:, 1] / 256000

    def error_ms(self):
        return (self.time_ns - self.start_ns) / 1e6 - self.made_at_s() * 1e3


def telling_time(time_s):
    """A signal that says when it was sampled: whole seconds on x, the rest on y (to 4 us)."""
    return int(time_s) / 1000, time_s % 1.0, -1.0


@pytest.fixture
def rig(chips):
    def make(**arguments):
        return Rig(chips, **arguments)

    return make


def entry(counts, *, x=False, empty=False):
    return ((counts & 0xFFFFF) << 4 | empty << 1 | x).to_bytes(3, "big")


def sample(x, y, z):
    return entry(x, x=True) + entry(y) + entry(z)


# Opening


def test_opening_identifies_resets_configures_in_standby_reads_back_and_starts(rig):
    made = rig(odr_hz=1000.0, range_g=4, block_samples=16)
    made.open()
    exchange = [
        (kind, register, detail) for kind, register, detail in made.chip.log if (kind, register) != ("read", STATUS)
    ]
    assert exchange == [
        ("read", 0x00, 4),
        ("write", 0x2F, 0x52),
        *[("write", POWER_CTL, 0x01), ("read", POWER_CTL, 1)],
        *[("write", RANGE, 0x82), ("read", RANGE, 1)],
        *[("write", 0x28, 0x02), ("read", 0x28, 1)],
        *[("write", 0x29, 48), ("read", 0x29, 1)],
        *[("write", POWER_CTL, 0x00), ("read", POWER_CTL, 1)],
    ]
    assert made.opened_bus == 1


@pytest.mark.parametrize(("odr_hz", "code"), list(zip(RATES_HZ, range(11), strict=True)))
def test_every_rate_has_its_code(rig, odr_hz, code):
    made = rig(odr_hz=odr_hz)
    made.open()
    assert made.chip.registers[0x28] == code
    assert made.chip.odr_hz == odr_hz


@pytest.mark.parametrize(("range_g", "code", "units_per_g"), [(2, 0x81, 256000), (4, 0x82, 128000), (8, 0x83, 64000)])
def test_ranges_and_what_is_known_of_the_part(rig, range_g, code, units_per_g):
    made = rig(range_g=range_g, revision=0x07)
    info = made.open()
    assert made.chip.registers[RANGE] == code
    assert (info.kind, info.unit, info.odr_hz) == ("adxl355", "counts", 125.0)
    assert (info.units_per_g, info.full_scale_g) == (units_per_g, range_g)
    assert info.device_id == "adxl355-07-i2c1-1d"
    assert info.zero_g_offset_g == 0.075
    assert info.bandwidth_hz == info.odr_hz / 4
    assert info.noise_g == noise_g(125.0)
    made.read_s(1)
    assert np.concatenate([block.raw for block in made.blocks]).tolist() == [[0, 0, units_per_g]] * made.samples


def test_a_label_is_the_identity_where_there_is_one(rig):
    assert rig(serial="hoist-2").open().device_id == "adxl355-hoist-2"


def test_noise_is_between_that_of_a_brick_wall_and_a_single_pole():
    assert noise_g(4000) == pytest.approx(22.5e-6 * math.sqrt(1000 * math.pi / 2))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"odr_hz": 100.0}, "no output data rate of 100 Hz; it has 4000, 2000, 1000, 500, 250, 125, 62.5"),
        ({"range_g": 16}, "no range of 16 g; it has 2, 4 and 8"),
        ({"block_samples": 0}, "1 to 16"),
    ],
)
def test_what_the_part_does_not_have_is_refused(rig, arguments, words):
    with pytest.raises(ValueError, match=words):
        rig(**arguments)


def test_another_part_at_the_address_is_named(rig):
    made = rig()
    made.chip.registers.update({0x00: 0xE5, 0x01: 0x00, 0x02: 0x00})
    with pytest.raises(IdentityError, match=r"^I2C bus 1 address 0x1d: identity reads E5 00 00, .* this is an ADXL345"):
        made.open()
    assert made.chip.closed


def test_nothing_at_the_address(rig):
    made = rig(address=0x53)
    with pytest.raises(TransferError, match="address 0x1d: no acknowledge; check wiring, supply and address"):
        made.open()


@pytest.mark.parametrize("refuses", [False, True])
def test_a_part_that_takes_long_to_reset_is_waited_for(rig, refuses):
    made = rig(busy_s=0.1, refuses_while_busy=refuses)
    made.open()
    assert made.read_s(1)


def test_a_part_that_never_comes_out_of_reset_is_given_up(rig):
    made = rig(busy_s=10)
    with pytest.raises(TransferError, match=r"still busy 0\.2 s after reset; power-cycle"):
        made.open()
    assert made.clock.elapsed_s < 1


@pytest.mark.parametrize(
    ("register", "name"), [(RANGE, "RANGE"), (0x28, "FILTER"), (0x29, "FIFO_SAMPLES"), (POWER_CTL, "POWER_CTL")]
)
def test_a_register_that_ignores_its_write_is_named(rig, register, name):
    made = rig(range_g=8)
    made.chip.deaf.add(register)
    with pytest.raises(ConfigurationReadBackError, match=rf"register {name} \({register:#04x}\)"):
        made.open()


def test_a_few_transfers_that_fail_while_opening_are_survived(rig):
    made = rig()
    made.chip.fail(errno.EREMOTEIO, 2)
    made.open()
    assert made.device.faults["i2c_no_acknowledge"] == 2


# Decoding


def test_golden_vectors():
    assert decode_counts(bytes.fromhex("7ffff1 800000 fffff0 000011 03e800 fc1800")).tolist() == [
        [524287, -524288, -1],
        [1, 16000, -16000],
    ]


@given(st.lists(st.tuples(COUNTS, COUNTS, COUNTS), max_size=33))
def test_any_triples_come_back(triples):
    runs, tail = split_entries(b"".join(sample(*triple) for triple in triples))
    assert tail == b""
    assert [row for run in runs for row in decode_counts(run.entries).tolist()] == [list(triple) for triple in triples]


@pytest.mark.parametrize(
    ("before", "lost", "after"),
    [
        (entry(8) + entry(9), 1, b""),  # the rest of a sample whose x went elsewhere
        (sample(1, 2, 3) + entry(4, x=True), 1, b""),
        (sample(1, 2, 3) + entry(4, x=True) + entry(5), 1, b""),
        (sample(1, 2, 3) + entry(7), 1, b""),
        (sample(1, 2, 3) + entry(0, empty=True), 0, b""),
        (sample(1, 2, 3), 0, entry(4, x=True)),
        (sample(1, 2, 3), 0, entry(4, x=True) + entry(5)),
        (b"\xff\xff\xff" * 3, 0, b"\xff\xff\xff"),
    ],
)
def test_alignment_is_found_again_at_the_x_marker(before, lost, after):
    runs, tail = split_entries(before + sample(10, -11, 12) + sample(13, 14, 15) + after)
    assert decode_counts(runs[-1].entries)[-2:].tolist() == [[10, -11, 12], [13, 14, 15]]
    assert sum(run.lost for run in runs) == lost
    assert tail == (b"" if after.startswith(b"\xff") else after)


def test_a_broken_end_is_counted_with_what_comes_next():
    runs, tail = split_entries(sample(1, 2, 3) + entry(4))
    assert runs == [Run(sample(1, 2, 3), 0), Run(b"", 1)]
    assert tail == b""


@given(st.binary(max_size=300))
def test_any_bytes_are_survived(data):
    entries = data[: len(data) // 3 * 3]
    runs, tail = split_entries(entries)
    taken = sum(len(run.entries) for run in runs) + len(tail)
    assert taken <= len(entries)
    assert all(decode_counts(run.entries).shape == (len(run), 3) for run in runs)


def test_temperature_of_the_data_sheet():
    assert temperature_c(1885) == 25.0
    assert temperature_c(1885 - 181) == pytest.approx(45.0)


# Steady reading


@pytest.mark.parametrize(
    ("odr_hz", "block_samples", "seconds"), [(125.0, 7, 60), (1000.0, 32, 20), (4000.0, 32, 5), (3.90625, 8, 60)]
)
def test_every_sample_comes_once_and_in_order(rig, odr_hz, block_samples, seconds):
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


@settings(max_examples=6, deadline=None)
@given(rate_error=st.floats(-0.05, 0.05), oversleep_s=st.sampled_from([0.0001, 0.002, 0.02]))
def test_times_are_right_whatever_the_part_and_the_host_do(chips, rate_error, oversleep_s):
    made = Rig(chips, rate_error=rate_error, oversleep_s=oversleep_s, block_samples=7, signal=telling_time)
    made.open()
    made.read_s(180)
    error_ms = made.error_ms()[made.made_at_s() > 10]
    assert error_ms.std() < 0.25
    assert abs(error_ms.mean()) < 0.5
    assert np.abs(made.error_ms()).max() < 10


@pytest.mark.parametrize("rate_error", [-0.05, 0.05])
def test_the_moment_of_sampling_is_found_within_two_seconds(rig, rate_error):
    made = rig(rate_error=rate_error, signal=telling_time)
    made.open()
    made.read_s(4)
    assert np.abs(made.error_ms()[made.made_at_s() > 2]).max() < 1


def test_a_read_never_waits_much_longer_than_half_a_second(rig):
    made = rig(odr_hz=3.90625, block_samples=16)
    made.open()
    waits = []
    for _ in range(20):
        start_s = made.clock.elapsed_s
        made.device.read()
        waits.append(made.clock.elapsed_s - start_s)
    assert max(waits) < 0.51


def test_temperature_comes_with_the_blocks(rig):
    made = rig()
    made.chip.temperature_raw = 1885 - 181
    made.open()
    made.read_s(1)
    assert {block.temperature_c for block in made.blocks} == {temperature_c(1885 - 181)}


def test_temperature_that_changes_while_it_is_read_is_read_again(rig):
    made = rig()
    made.chip.temperature_raw = 0x6FF
    made.chip.temperature_steps = [0x6FF, 0x700, 0x700]  # high byte of one, low byte of the other
    made.open()
    made.read_s(0.5)
    assert made.blocks[0].temperature_c == temperature_c(0x6FF)


def test_temperature_that_never_stands_is_not_given(rig):
    made = rig()
    made.chip.temperature_steps = [raw << 8 for raw in range(1, 13)]
    made.open()
    made.read_s(0.5)
    assert made.blocks[0].temperature_c is None
    assert made.device.faults["unstable_temperature"] == 1


def test_open_again_after_close(rig):
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


# What goes wrong


def test_overrun_is_counted_and_its_length_told_by_time(rig):
    made = rig(signal=telling_time, rate_error=0.05)
    made.open()
    made.read_s(20)
    made.chip.run_s(2)
    made.read_s(20)
    assert made.device.faults["overrun"] == 1
    assert made.chip.overwritten > 200
    assert made.lost == pytest.approx(made.chip.overwritten, abs=1)
    assert np.abs(made.error_ms()[made.made_at_s() > 10]).max() < 8  # a period
    assert np.all(np.diff(made.time_ns) > 0)


@pytest.mark.parametrize("entries", [1, 2])
def test_entries_that_vanish_cost_one_sample(rig, entries):
    made = rig(signal=telling_time, rate_error=-0.05)
    made.open()
    made.read_s(20)
    made.chip.run_s(0.05)
    made.chip.drop_entries(entries)
    made.read_s(20)
    assert made.device.faults["misaligned"] == 1
    assert made.lost == 1
    assert made.samples + 1 == len(made.chip.made_ns) - len(made.chip.fifo) // 3
    assert np.abs(made.error_ms()[made.made_at_s() > 10]).max() < 1  # none is mixed of two


def test_a_level_that_promises_too_much_yields_no_invented_samples(rig):
    made = rig(signal=telling_time)
    made.open()
    made.read_s(5)
    made.chip.level_error = 9
    made.read_s(5)
    assert np.all(np.diff(made.made_at_s()) > 0.007)
    assert made.lost == 0


def test_refused_transfers_cost_nothing(rig):
    made = rig(signal=telling_time)
    made.open()
    made.read_s(5)
    made.chip.fail(errno.EREMOTEIO, 2, register=FIFO_DATA)
    made.chip.fail(errno.EAGAIN, 2, register=STATUS)
    made.read_s(5)
    assert made.device.faults["i2c_no_acknowledge"] == 2
    assert made.device.faults["i2c_bus_error"] == 2
    assert made.lost == 0
    assert np.all(np.diff(made.made_at_s()) < 0.009)


@pytest.mark.parametrize("popped", [0, 4, 21])
def test_a_burst_that_breaks_off_loses_what_it_took(rig, popped):
    made = rig(signal=telling_time)
    made.open()
    made.read_s(5)
    made.chip.fail(errno.EIO, 1, register=FIFO_DATA, popped=popped)
    made.read_s(5)
    assert made.lost == math.ceil(popped / 3)
    assert np.abs(made.error_ms()[made.made_at_s() > 3]).max() < 8
    assert np.all(np.diff(made.time_ns) > 0)


def test_bursts_that_break_off_now_and_then_are_survived(rig):
    made = rig(signal=telling_time)
    made.open()
    made.read_s(2)
    for _ in range(5):
        made.chip.fail(errno.EIO, 1, register=FIFO_DATA, popped=3)
        made.read_s(2)
    assert made.lost == 5
    assert made.device.faults["i2c_bus_error"] == 5


@pytest.mark.parametrize(
    ("number", "register"), [(errno.EREMOTEIO, None), (errno.ETIMEDOUT, None), (errno.EIO, FIFO_DATA)]
)
def test_transfers_that_keep_failing_are_given_up_in_bounded_time(rig, number, register):
    made = rig()
    made.open()
    made.read_s(1)
    made.chip.fail(number, 1000, register=register)
    start_s = made.clock.elapsed_s
    with pytest.raises(TransferError, match="I2C bus 1 address 0x1d"):
        made.read_s(10)
    assert made.clock.elapsed_s - start_s < 2


def test_a_brown_out_is_noticed_within_two_seconds(rig):
    made = rig(range_g=4)
    made.open()
    made.read_s(3)
    made.chip.brown_out()
    start_s = made.clock.elapsed_s
    with pytest.raises(
        ConfigurationReadBackError, match=r"RANGE \(0x2c\) reads 0x81, not 0x82.*POWER_CTL.*lost its configuration"
    ):
        made.read_s(10)
    assert made.clock.elapsed_s - start_s < 2
    assert made.device.faults["configuration_lost"] == 1
    made.open()
    assert made.read_s(1)


def test_a_range_that_changed_by_itself_is_noticed(rig):
    made = rig(range_g=8)
    made.open()
    made.read_s(3)
    made.chip.registers[RANGE] = 0x81
    with pytest.raises(ConfigurationReadBackError, match="RANGE"):
        made.read_s(2)


def test_a_bus_stuck_high_is_no_data(rig):
    made = rig()
    made.open()
    made.read_s(1)
    samples = made.samples
    made.chip.stuck_high = True
    with pytest.raises(ConfigurationReadBackError, match="reads 0xff"):
        made.read_s(10)
    assert made.samples == samples


def test_a_part_that_makes_no_samples_is_given_up_after_two_seconds(rig):
    made = rig()
    made.open()
    made.read_s(1)
    made.chip.oscillating = False
    start_s = made.clock.elapsed_s
    with pytest.raises(TransferError, match="no samples for 2 s; power-cycle the sensor"):
        made.read_s(10)
    assert 2 < made.clock.elapsed_s - start_s < 3


def test_nothing_new_is_none_and_takes_half_a_second(rig):
    made = rig()
    made.open()
    made.read_s(1)
    made.chip.oscillating = False
    while made.device.read() is not None:
        pass
    start_s = made.clock.elapsed_s
    assert made.device.read() is None
    assert 0.4 < made.clock.elapsed_s - start_s < 0.6


@pytest.mark.parametrize(
    ("register", "bits"),
    [(STATUS, [0x10]), (STATUS, [0x80]), (STATUS, [0xE0]), (LEVEL, [0x60]), (RANGE, [0x02]), (POWER_CTL, [0x01])],
)
def test_one_disturbed_reading_is_survived(rig, register, bits):
    made = rig(signal=telling_time)
    made.open()
    made.read_s(2)
    made.chip.disturbed[register] = bits
    made.read_s(2)
    assert made.device.faults.get("nonsense_status", 0) == (register in {STATUS, LEVEL})
    assert made.chip.disturbed[register] == []
    assert made.lost == 0
    assert np.all(np.diff(made.made_at_s()) < 0.009)


def test_a_level_seen_between_the_axes_of_a_sample_costs_nothing(rig):
    made = rig(signal=telling_time)
    made.open()
    made.read_s(2)
    for missing in (-1, -2, 0, -1):
        made.chip.level_error = missing
        made.read_s(1)
    assert made.lost == 0
    assert np.all(np.diff(made.made_at_s()) < 0.009)
