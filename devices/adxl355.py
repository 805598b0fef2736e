"""Analog Devices ADXL355: 20-bit triaxial MEMS accelerometer, read through its FIFO over I2C.

The part has neither a serial number nor a readable clock; `devices.sample_clock` determines the sample times.
"""

import math
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

from smbus2 import SMBus

from devices.adxl355_fifo import ENTRY_BYTES, FIFO_ENTRIES, SampleRun, decode_counts, split_entries
from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.errors import ConfigurationReadBackError, DeviceError, IdentityError, TransferError
from devices.i2c import BusOpener, I2cPart
from devices.sample_clock import SampleClock

DEVID_AD, STATUS, TEMP2, FIFO_DATA = 0x00, 0x04, 0x06, 0x11
FILTER, FIFO_SAMPLES, RANGE, POWER_CTL, RESET = 0x28, 0x29, 0x2C, 0x2D, 0x2F
NAMES = {FILTER: "FILTER", FIFO_SAMPLES: "FIFO_SAMPLES", RANGE: "RANGE", POWER_CTL: "POWER_CTL"}
IDENTITY = b"\xad\x1d\xed"
KNOWN_IDENTITIES = {0xE5: "an ADXL345"}
RESET_CODE = 0x52
STANDBY, MEASURE = 0x01, 0x00
RANGE_HIGH_SPEED = 0x80
"""The default of the other bits of the RANGE register: I2C high-speed mode allowed."""
OVERRUN, NVM_BUSY, STATUS_UNUSED = 0x04, 0x10, 0xE0

RATES_HZ = tuple(4000.0 / (1 << k) for k in range(11))
"""Output data rates by their code in the FILTER register."""
UNITS_PER_G = {2: 256000.0, 4: 128000.0, 8: 64000.0}
RANGE_CODES = {2: 1, 4: 2, 8: 3}
NOISE_G_PER_ROOT_HZ = 22.5e-6
ZERO_G_OFFSET_G = 0.075
ZERO_G_OFFSET_G_PER_K = 0.15e-3
SCALE_FACTOR_PER_K = 1e-4

ENTRIES_MARGIN = 3
"""The FIFO level may exceed the FIFO's size by this many entries; a higher one is a transfer error."""
LONGEST_BLOCK = 16
"""Largest number of samples that a read waits for. Half of the FIFO remains free for a late host."""

LONGEST_WAIT_NS = 500_000_000
SILENCE_NS = 2_000_000_000
CHECK_NS = 1_000_000_000
"""Period of the checks of configuration and temperature, and of the search for the moment of sampling."""
PROBE_NS = 4_000_000
PROBE_LOOKS = 8
SETTLED_RATE_U = 1e-4
"""The moment of sampling is searched for at every read until the rate has this relative uncertainty."""
RESET_NS, RESET_POLL_S = 200_000_000, 0.002
TEMPERATURE_READS = 4
BURST_FAILURES = 3


def temperature_c(raw: int) -> float:
    """Return degrees Celsius for a 12-bit reading: nominally 1885 at 25 °C and -9.05 per degree."""
    return 25.0 + (raw - 1885) / -9.05


def noise_g(odr_hz: float) -> float:
    """Return the typical noise per sample and axis, 1 sigma: noise density times the root of the noise bandwidth.

    The part's filter has its -3 dB point at a quarter of the rate. Its noise bandwidth is between that (an ideal filter) and
    pi/2 times that (a first-order filter); the upper value is used.
    """
    return NOISE_G_PER_ROOT_HZ * math.sqrt(math.pi / 2 * odr_hz / 4)


@dataclass(frozen=True, slots=True)
class _Level:
    """The number of entries in the FIFO at a time."""

    entries: int
    read_ns: int


class Adxl355:
    """An ADXL355 on an I2C bus."""

    def __init__(
        self,
        bus: int,
        address: int = 0x1D,
        *,
        clock: Clock,
        odr_hz: float = 125.0,
        range_g: float = 2,
        block_samples: int = 8,
        serial: str | None = None,
        open_bus: BusOpener = SMBus,
    ) -> None:
        """`block_samples`: usual length of a block, at most 16; `serial`: a label, for the part has no number.

        Raises `ValueError` for a rate or a range that the part does not have.
        """
        rate_hz = min(RATES_HZ, key=lambda rate_hz: abs(rate_hz - odr_hz))
        if not math.isclose(rate_hz, odr_hz, rel_tol=1e-3):
            rates = ", ".join(f"{rate_hz:g}" for rate_hz in RATES_HZ)
            raise ValueError(f"the ADXL355 has no output data rate of {odr_hz:g} Hz; it has {rates}")
        if range_g not in UNITS_PER_G:
            raise ValueError(f"the ADXL355 has no range of {range_g:g} g; it has 2, 4 and 8")
        if block_samples < 1:
            raise ValueError(f"a block of {block_samples} samples is impossible; give 1 to {LONGEST_BLOCK}")
        self._bus = bus
        self._address = address
        self._odr_hz = rate_hz
        self._range_g = int(range_g)
        self._block_samples = min(block_samples, LONGEST_BLOCK)
        self._serial = serial
        self._clock = clock
        self._part = I2cPart(bus, address, clock, open_bus)
        self._sample_clock = SampleClock(rate_hz, usual_delay_s=1 / rate_hz)
        self._probe_ns = min(round(0.5e9 / rate_hz), PROBE_NS)
        self._configuration = {
            RANGE: RANGE_HIGH_SPEED | RANGE_CODES[self._range_g],
            FILTER: RATES_HZ.index(rate_hz),
            FIFO_SAMPLES: 3 * self._block_samples,
            POWER_CTL: MEASURE,
        }
        self._faults: Counter[str] = Counter()
        self._reset_state()

    def open(self) -> DeviceInfo:
        """Identify, reset, configure and start the part.

        Raises `DeviceNotFoundError` or `DeviceAccessError` (bus), `IdentityError`, `ConfigurationReadBackError`,
        `TransferError`.
        """
        self._part.open()
        try:
            revision = self._identify()
            self._reset()
            self._configure()
        except DeviceError:
            self._part.close()
            raise
        self._reset_state()
        return self._info(revision)

    def read(self) -> SampleBlock | None:
        """Return the next block; after lost samples a new block begins.

        Raises `ConfigurationReadBackError` when the part has lost its configuration, `TransferError` when it cannot be read or
        has been silent for two seconds.
        """
        if not self._blocks:
            self._receive()
        return self._blocks.popleft() if self._blocks else None

    def close(self) -> None:
        """Release the bus; the part continues to sample."""
        self._part.close()

    @property
    def faults(self) -> Mapping[str, int]:
        """Failed transfers by kind, `overrun`, `misaligned`, `nonsense_status`, `configuration_lost` and others."""
        return {**self._part.faults, **self._faults, "clock_relearned": self._sample_clock.relearned}

    def _reset_state(self) -> None:
        """Reset the state to that of a part that has just been started."""
        self._sample_clock.restart()
        self._blocks: deque[SampleBlock] = deque()
        self._tail = b""  # entries of an incomplete sample
        self._last_ns: int | None = None
        self._lost = 0
        self._lost_at_least: int | None = None  # None while the samples can be counted
        self._burst_failures = 0
        self._temperature_c: float | None = None
        self._last_received_ns = self._check_due_ns = self._clock.now_ns()

    def _info(self, revision: int) -> DeviceInfo:
        number = self._serial or f"{revision:02x}-i2c{self._bus}-{self._address:02x}"
        return DeviceInfo(
            kind="adxl355",
            device_id=f"adxl355-{number}",
            unit="counts",
            odr_hz=self._odr_hz,
            units_per_g=UNITS_PER_G[self._range_g],
            full_scale_g=float(self._range_g),
            noise_g=noise_g(self._odr_hz),
            zero_g_offset_g=ZERO_G_OFFSET_G,
            bandwidth_hz=self._odr_hz / 4,
            zero_g_offset_g_per_k=ZERO_G_OFFSET_G_PER_K,
            scale_factor_per_k=SCALE_FACTOR_PER_K,
            details={
                "bus": f"/dev/i2c-{self._bus}",
                "address": f"{self._address:#04x}",
                "revision": f"{revision:#04x}",
                "bandwidth_hz": f"{self._odr_hz / 4:g}",
            },
        )

    def _identify(self) -> int:
        """Read the identity registers; return the revision of the part."""
        found = self._part.read(DEVID_AD, 4)
        if found[:3] != IDENTITY:
            known = KNOWN_IDENTITIES.get(found[0], "another part")
            raise IdentityError(
                f"{self._part}: identity reads {found[:3].hex(' ').upper()}, an ADXL355 has {IDENTITY.hex(' ').upper()};"
                f" this is {known}, name its kind or the right address"
            )
        return found[3]

    def _reset(self) -> None:
        self._part.write(RESET, RESET_CODE)
        deadline_ns = self._clock.now_ns() + RESET_NS
        while self._clock.now_ns() < deadline_ns:
            self._clock.sleep_s(RESET_POLL_S)
            with suppress(TransferError):  # it may not answer while it is busy
                if not self._part.read(STATUS, 1)[0] & NVM_BUSY:
                    return
        raise TransferError(f"{self._part}: still busy {RESET_NS / 1e9:g} s after reset; power-cycle the sensor")

    def _configure(self) -> None:
        self._part.write_checked(POWER_CTL, STANDBY, NAMES[POWER_CTL])
        for register, value in self._configuration.items():  # the last register starts the part
            self._part.write_checked(register, value, NAMES[register])

    def _receive(self) -> None:
        """Wait up to half a second for a block of samples, and read the samples that are there."""
        start_ns = self._clock.now_ns()
        rate_u_hz = self._sample_clock.measured_rate_u_hz
        probing = rate_u_hz is None or rate_u_hz > SETTLED_RATE_U * self._odr_hz
        if start_ns >= self._check_due_ns:
            self._check()
            self._check_due_ns = start_ns + CHECK_NS
            probing = True
        early_ns = self._probe_ns if probing else 0
        deadline_ns = start_ns + LONGEST_WAIT_NS
        while not self._blocks:
            level = self._await_level(deadline_ns, early_ns)
            self._blocks.extend(self._drain_fifo(level))
            if level.read_ns >= deadline_ns:
                break
            if not self._blocks:
                self._clock.sleep_s(1 / self._odr_hz)
        if self._blocks:
            self._last_received_ns = level.read_ns
        elif level.read_ns - self._last_received_ns > SILENCE_NS:
            raise TransferError(f"{self._part}: no samples for {SILENCE_NS / 1e9:g} s; power-cycle the sensor")

    def _await_level(self, deadline_ns: int, early_ns: int) -> _Level:
        """Sleep until the samples of a block are due, and poll until they are there.

        A host that always reads when it expects a sample cannot detect that the sample was there before. From time to time it
        therefore begins to poll `early_ns` earlier.
        """
        now_ns = soonest_ns = self._clock.now_ns()
        while True:
            due_ns = self._sample_clock.due_ns(self._block_samples)
            wake_ns = soonest_ns if due_ns is None else max(soonest_ns, due_ns - early_ns)
            self._clock.sleep_s((min(wake_ns, deadline_ns) - now_ns) / 1e9)
            level = self._poll()
            samples = (len(self._tail) // ENTRY_BYTES + level.entries) // 3
            now_ns = level.read_ns
            if samples >= self._block_samples or now_ns >= deadline_ns:
                return level
            if samples:
                self._sample_clock.stamp(0, now_ns, behind=samples)
            soonest_ns = now_ns + self._probe_ns // PROBE_LOOKS

    def _poll(self) -> _Level:
        """Read the level of the FIFO. Reading the status clears the overrun bit."""
        status, entries = self._part.read(STATUS, 2)
        read_ns = self._clock.now_ns()
        if status & (NVM_BUSY | STATUS_UNUSED) or entries > FIFO_ENTRIES + ENTRIES_MARGIN:
            self._faults["nonsense_status"] += 1
            self._verify()
            return _Level(0, read_ns)
        if status & OVERRUN:
            self._faults["overrun"] += 1
            self._reset_sample_index(1)
        return _Level(entries, read_ns)

    def _drain_fifo(self, level: _Level) -> list[SampleBlock]:
        """Read the entries out of the FIFO. After a burst that was interrupted, the number of removed entries is unknown."""
        if not level.entries:
            return []
        try:
            burst = self._part.read(FIFO_DATA, ENTRY_BYTES * level.entries, consuming=True)
        except TransferError:
            self._burst_failures += 1
            if self._burst_failures == BURST_FAILURES:
                raise
            self._reset_sample_index(0)
            return []
        self._burst_failures = 0
        runs, self._tail = split_entries(self._tail + burst)
        return list(self._make_blocks(runs, level.read_ns))

    def _make_blocks(self, runs: list[SampleRun], read_ns: int) -> Iterator[SampleBlock]:
        behind = sum(len(run) + run.lost for run in runs)
        for run in runs:
            behind -= len(run) + run.lost
            self._lost += run.lost
            self._faults["misaligned"] += run.lost
            time_ns = self._sample_clock.stamp(len(run), read_ns, lost=run.lost, behind=behind)
            if len(run):
                lost = self._lost_before(int(time_ns[0]))
                yield SampleBlock(time_ns, decode_counts(run.entries), self._temperature_c, lost)
                self._last_ns, self._lost, self._lost_at_least = int(time_ns[-1]), 0, None

    def _reset_sample_index(self, at_least: int) -> None:
        """Restart the sample clock after the loss of an unknown number of samples, which the times determine."""
        self._lost_at_least = max(at_least, self._lost_at_least or 0)
        self._tail = b""
        self._sample_clock.restart()

    def _lost_before(self, first_ns: int) -> int:
        if self._lost_at_least is None:
            return self._lost
        if self._last_ns is None:
            return self._lost_at_least
        rate_hz = self._sample_clock.measured_rate_hz or self._odr_hz
        return max(round((first_ns - self._last_ns) * rate_hz / 1e9) - 1, self._lost_at_least)

    def _check(self) -> None:
        """Verify the configuration and read the temperature."""
        self._verify()
        for _ in range(TEMPERATURE_READS):
            high, low = self._part.read(
                TEMP2, 2
            )  # not latched: the bytes belong together if the high byte has not changed
            if self._part.read(TEMP2, 1)[0] == high:
                self._temperature_c = temperature_c((high & 0x0F) << 8 | low)
                return
        self._faults["unstable_temperature"] += 1

    def _verify(self) -> None:
        """Raise `ConfigurationReadBackError` when a register differs from its configuration in two readings."""
        if self._configuration_differences() and (differing := self._configuration_differences()):
            self._faults["configuration_lost"] += 1
            raise ConfigurationReadBackError(
                f"{self._part}: {differing}; the part has lost its configuration, check its supply and cable"
            )

    def _configuration_differences(self) -> str:
        found = self._part.read(FILTER, POWER_CTL - FILTER + 1)
        return ", ".join(
            f"register {NAMES[register]} ({register:#04x}) reads {found[register - FILTER]:#04x}, not {value:#04x}"
            for register, value in self._configuration.items()
            if found[register - FILTER] != value
        )
