"""An accelerometer with a FIFO on an I2C bus, whatever the chip.

Such a part has neither a serial number nor a readable clock; `devices.sample_clock` determines the sample times.
"""

from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import replace

from smbus2 import SMBus

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import MAX_READ_NS, MAX_SILENCE_NS
from devices.errors import ConfigurationReadBackError, DeviceError, TransferError
from devices.i2c.accelerometer_chip import (
    AccelerometerChip,
    FifoLevel,
    ImplausibleStatusError,
    LostAlignmentError,
    SampleRun,
)
from devices.i2c.bus import BusOpener, I2cPart, identify
from devices.sample_clock import SampleClock
from devices.saturation import mark_saturated

CHECK_NS = 1_000_000_000
"""Period of the checks of configuration and temperature, and of the search for the moment of sampling. Basis: a choice; a part
that was reset is noticed within a second, for a few transfers."""
PROBE_NS = 4_000_000
"""Longest search for the moment of sampling. Basis: a choice; the period at 250 Hz, and no load of the bus."""
PROBE_LOOKS = 8
"""Basis: a choice; a level of the FIFO takes some tenths of a millisecond, so that `PROBE_NS` is nearly filled."""
SETTLED_RATE_U = 1e-4
"""The moment of sampling is searched for at every read until the rate has this relative uncertainty. Basis: a choice; a minute of
samples is then timed to 6 ms."""
BURST_FAILURES = 3
"""Basis: a choice; as many attempts as a transfer has."""


class FifoAccelerometer:
    """A chip on an I2C bus."""

    def __init__(
        self,
        chip: AccelerometerChip,
        bus: int,
        address: int,
        *,
        clock: Clock,
        block_samples: int = 8,
        serial: str | None = None,
        open_bus: BusOpener = SMBus,
    ) -> None:
        """`block_samples`: usual length of a block; `serial`: a label, for the part has no number. Raises `ValueError`."""
        if block_samples < 1:
            raise ValueError(f"a block of {block_samples} samples is impossible; give 1 to {chip.longest_block}")
        self._chip = chip
        self._bus = bus
        self._address = address
        self._odr_hz = chip.info.odr_hz
        self._block_samples = min(block_samples, chip.longest_block)
        self._serial = serial
        self._clock = clock
        self._part = I2cPart(bus, address, clock, open_bus)
        self._sample_clock = SampleClock(self._odr_hz, usual_delay_s=1 / self._odr_hz)
        self._probe_ns = min(round(0.5e9 / self._odr_hz), PROBE_NS)
        self._expected = sorted({setting.register: setting for setting in chip.configuration}.values())
        self._faults: Counter[str] = Counter()
        self._reset_state()

    def open(self) -> DeviceInfo:
        """Identify, reset, configure and start the part.

        Raises `DeviceNotFoundError` or `DeviceAccessError` (bus), `IdentityError`, `ConfigurationReadBackError`,
        `TransferError`.
        """
        self._part.open()
        try:
            revision = self._chip.revision(self._part, identify(self._part, *self._chip.kind.identities))
            self._chip.reset(self._part, self._clock)
            for setting in self._chip.configuration:
                self._part.write_checked(setting.register, setting.value, setting.name)
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
        self._chip.forget_partial()
        self._blocks: deque[SampleBlock] = deque()
        self._last_ns: int | None = None
        self._lost = 0
        self._lost_at_least: int | None = None  # None while the samples can be counted
        self._burst_failures = 0
        self._temperature_c: float | None = None
        self._last_received_ns = self._check_due_ns = self._clock.now_ns()

    def _info(self, revision: str) -> DeviceInfo:
        info = self._chip.info
        place = f"i2c{self._bus}-{self._address:02x}"
        number = self._serial or "-".join(filter(None, (revision, place)))
        details = {"bus": f"/dev/i2c-{self._bus}", "address": f"{self._address:#04x}"}
        if revision:
            details["revision"] = f"0x{revision}"
        if info.bandwidth_hz is not None:
            details["bandwidth_hz"] = f"{info.bandwidth_hz:g}"
        return replace(info, device_id=f"{info.kind}-{number}", details=details)

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
        deadline_ns = start_ns + MAX_READ_NS
        while not self._blocks:
            level = self._await_level(deadline_ns, early_ns)
            self._blocks.extend(self._drain_fifo(level))
            if level.read_ns >= deadline_ns:
                break
            if not self._blocks:
                self._clock.sleep_s(1 / self._odr_hz)
        if self._blocks:
            self._last_received_ns = level.read_ns
        elif level.read_ns - self._last_received_ns > MAX_SILENCE_NS:
            raise TransferError(f"{self._part}: no samples for {MAX_SILENCE_NS / 1e9:g} s; power-cycle the sensor")

    def _await_level(self, deadline_ns: int, early_ns: int) -> FifoLevel:
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
            samples = level.samples
            now_ns = level.read_ns
            if samples >= self._block_samples or now_ns >= deadline_ns:
                return level
            if samples:
                self._sample_clock.stamp(0, now_ns, behind=samples)
            soonest_ns = now_ns + self._probe_ns // PROBE_LOOKS

    def _poll(self) -> FifoLevel:
        """Read the level of the FIFO."""
        try:
            level = self._chip.fifo_level(self._part, self._clock)
        except ImplausibleStatusError:
            self._faults["nonsense_status"] += 1
            self._verify()
            return FifoLevel(0, 0, self._clock.now_ns())
        if level.lost_at_least is not None:
            self._faults["overrun"] += 1
            self._reset_sample_index(level.lost_at_least)
        return level

    def _drain_fifo(self, level: FifoLevel) -> list[SampleBlock]:
        """Read the FIFO. After a burst that was interrupted, the number of removed samples is unknown."""
        if not level.size:
            return []
        try:
            runs = self._chip.read_fifo(self._part, level.size)
        except TransferError:
            self._burst_failures += 1
            if self._burst_failures == BURST_FAILURES:
                raise
            self._reset_sample_index(0)
            return []
        except LostAlignmentError:
            self._faults["misaligned"] += 1
            self._reset_sample_index(1)
            return []
        self._burst_failures = 0
        return list(self._make_blocks(runs, level.read_ns))

    def _make_blocks(self, runs: list[SampleRun], read_ns: int) -> Iterator[SampleBlock]:
        behind = sum(len(run) + run.lost for run in runs)
        for run in runs:
            behind -= len(run) + run.lost
            self._lost += run.lost
            self._faults["broken_samples"] += run.lost
            time_ns = self._sample_clock.stamp(len(run), read_ns, lost=run.lost, behind=behind)
            if len(run):
                lost = self._lost_before(int(time_ns[0]))
                yield SampleBlock(
                    time_ns,
                    run.raw,
                    self._temperature_c,
                    lost,
                    gyro_counts=run.gyro_counts,
                    saturated=mark_saturated(run.raw, *self._chip.saturation_counts),
                )
                self._last_ns, self._lost, self._lost_at_least = int(time_ns[-1]), 0, None

    def _reset_sample_index(self, at_least: int) -> None:
        """Restart the sample clock after the loss of an unknown number of samples, which the times determine."""
        self._lost_at_least = max(at_least, self._lost_at_least or 0)
        self._chip.forget_partial()
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
        self._temperature_c = self._chip.temperature_c(self._part)

    def _verify(self) -> None:
        """Raise `ConfigurationReadBackError` when a register differs from its configuration in two readings."""
        if self._configuration_differences() and (differing := self._configuration_differences()):
            self._faults["configuration_lost"] += 1
            raise ConfigurationReadBackError(
                f"{self._part}: {differing}; the part has lost its configuration, check its supply and cable"
            )

    def _configuration_differences(self) -> str:
        return ", ".join(
            f"register {name} ({register:#04x}) reads {found:#04x}, not {value:#04x}"
            for register, name, value in self._expected
            if (found := self._part.read(register, 1)[0]) != value
        )
