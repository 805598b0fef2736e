"""The simulated crane as a device, in real time, and its rigger.

The rigger takes the housing off the rope, turns it to the faces that a recalibration asks for, and lays it down. A housing that
lies on a bench shows gravity alone. It is laid down a tenth of a degree beside the face, as against a square.
"""

import logging
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import MAX_READ_S
from devices.errors import DeviceError
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.saturation import mark_saturated
from devices.simulated.accelerometer import (
    DATASHEET_SCALE_FACTOR_PER_K,
    DATASHEET_ZERO_G_OFFSET_G_PER_K,
    ZERO_G_OFFSET_LIMIT_G,
    Accelerometer,
    InjectedErrors,
    factory_calibration,
    typical_ambient,
    typical_errors,
)
from devices.simulated.crane import Crane, GroundTruth
from devices.simulated.demo import demo_crane

log = logging.getLogger("plumbline.device")
Array = NDArray[np.float64]
MAX_LAG_S: Final = 1.0
"""After a longer delay (the host was suspended or overloaded) the device skips to the present, like a FIFO that overflows. Basis:
a choice; some FIFOs, and no jump by a busy core."""
MAX_CATCH_UP_S: Final = 30.0
"""Longest time by which the crane advances when samples are skipped; it stands still during the rest of the absence. Basis: a
choice; two swings of a long rope, computed in less than a second."""
REST_S: Final = 90.0
"""Time for which the load hangs still after the housing was hung back: long enough to zero the mount. Basis: three times the rest
that zeroing needs (30 s)."""
AHEAD_S: Final = 0.25
"""Readings are computed for this long at once, for any length of the blocks. Basis: numpy's cost is per call."""
TURN_S = 2.0
"""Time in which the housing is turned to another face. Basis: a choice; what a person takes."""
PLACEMENT_RAD = np.radians(0.08)
"""Standard deviation of the attitude in which the housing is laid down, about each axis across the vertical. Basis: a choice; a
machined housing on a table, within the 0.1 degrees of `MAX_TYPE_A_G`."""
SHAKE_G = 0.05
"""Standard deviation of the readings by the hand that turns the housing. Basis: twice the limit of a still window, so that it
counts as motion."""
UPRIGHT = np.array([0.0, 0.0, 1.0])
"""Definition: a unit vector."""


class SimulatedCrane:
    """A simulated accelerometer on the rope of a simulated crane; 1 g is the site's gravity."""

    def __init__(
        self,
        *,
        odr_hz: float,
        block_samples: int,
        length_m: float,
        position_m: float,
        clock: Clock,
        range_g: float = 2.0,
        gravity_m_s2: float = STANDARD_GRAVITY_M_S2,
        seed: int = 1,
        crane: Crane | None = None,
        errors: InjectedErrors | None = None,
    ) -> None:
        """The same seed gives the same readings. `crane` replaces the demonstration, `errors` those of the drawn sensor."""
        if odr_hz <= 0 or range_g <= 0 or block_samples < 1:
            raise ValueError(
                f"odr_hz {odr_hz:g}, range_g {range_g:g} and block_samples {block_samples} must all be positive"
            )
        self.crane = crane or demo_crane(seed, length_m, position_m, gravity_m_s2)
        self._seed, self._place_m = seed, (length_m, position_m)
        part_random, ambient_random, factory_random, self._noise, self._rigger_random = np.random.default_rng(
            [seed, 1]
        ).spawn(5)
        self.ambient = typical_ambient(ambient_random)
        self.part = Accelerometer(errors or typical_errors(part_random, self.ambient.mean_c), odr_hz, range_g)
        self._device_id = f"simulated-{seed}"
        self._factory_record = factory_calibration(self._device_id, self.part, factory_random)
        self._clock = clock
        self._period_ns = 1e9 / odr_hz
        self._block_samples = block_samples
        self._blocks_at_once = max(1, int(AHEAD_S * odr_hz / block_samples))
        self._faults: Counter[str] = Counter()
        self._ready: deque[SampleBlock] = deque()
        self._next = 0
        self._lost = 0
        self._opened_ns: int | None = None
        self._newest_ns: int | None = None
        self._crane_start_ns = 0
        self._rigger: Rigger | None = None
        self._orders: deque[Array | None] = deque()
        """Directions to turn the housing to; None: hang it back on the rope."""

    def open(self) -> DeviceInfo:
        """Start a new grid of sample times now; never fails."""
        now_ns = self._clock.now_ns()
        if self._newest_ns is None:
            self._crane_start_ns = now_ns
        else:
            self._shift_own_time(now_ns - self._newest_ns)
        self._opened_ns, self._next, self._lost = now_ns, 0, 0
        self._ready.clear()
        return DeviceInfo(
            kind="simulated",
            device_id=self._device_id,
            unit="counts",
            odr_hz=self.part.odr_hz,
            units_per_g=self.part.units_per_g,
            full_scale_g=self.part.full_scale_g,
            noise_g=self.part.noise_g,
            zero_g_offset_g=ZERO_G_OFFSET_LIMIT_G,
            zero_g_offset_g_per_k=DATASHEET_ZERO_G_OFFSET_G_PER_K,
            scale_factor_per_k=DATASHEET_SCALE_FACTOR_PER_K,
            factory_calibration=self._factory_record,
            details={"simulated": "nothing here was measured"},
        )

    def read(self) -> SampleBlock | None:
        """Return the next block at the time of its last sample; None if that is more than half a second away."""
        if self._opened_ns is None:
            raise DeviceError("simulated crane: read before open, or after close; call open first")
        if not self._ready:
            self._ready.extend(self._simulate(self._opened_ns))
        now_ns = self._clock.now_ns()
        wait_s = (int(self._ready[0].time_ns[-1]) - now_ns) / 1e9
        if wait_s < -MAX_LAG_S:
            self._drop_samples(self._opened_ns, now_ns)
            wait_s = 0.0
        if wait_s > MAX_READ_S:
            self._clock.sleep_s(MAX_READ_S)
            return None
        if len(self._ready) == 1:
            wait_s = self._simulate_while_waiting(self._opened_ns, wait_s)
        self._clock.sleep_s(wait_s)
        self._next += self._block_samples
        block = self._ready.popleft()
        self._log_captions(block)
        return block

    def close(self) -> None:
        """Stop; the crane continues when it is opened again."""
        self._opened_ns = None
        self._ready.clear()

    def turn_housing(self, up: Sequence[float]) -> None:
        """Take the housing off the rope and turn it so that a direction (3,) of the sensor points up. Called by any thread."""
        self._orders.append(self.part.errors.sensor_from_housing.T @ np.asarray(up, dtype=float))

    def hang_housing(self) -> None:
        """Hang the housing back on the rope: the load hangs still for `REST_S`, then swings again. Called by any thread."""
        self._orders.append(None)

    @property
    def faults(self) -> Mapping[str, int]:
        """`overrun`: how many times samples were skipped because nobody read them in time."""
        return self._faults

    def truth(self, time_ns: NDArray[np.int64]) -> GroundTruth:
        """Return the true state of the crane at sample times (n,) within the last half minute."""
        return self.crane.truth((time_ns - self._crane_start_ns) / 1e9)

    def _simulate_while_waiting(self, opened_ns: int, wait_s: float) -> float:
        """Compute the next readings in the middle of a wait, when the block before has been processed; return the rest of it."""
        due_ns = self._clock.now_ns() + round(wait_s * 1e9)
        self._clock.sleep_s(wait_s / 2)
        self._ready.extend(self._simulate(opened_ns))
        return (due_ns - self._clock.now_ns()) / 1e9

    def _simulate(self, opened_ns: int) -> Iterator[SampleBlock]:
        """Yield the blocks after those that are ready."""
        first_index = self._next + len(self._ready) * self._block_samples
        index = first_index + np.arange(self._blocks_at_once * self._block_samples)
        time_ns = opened_ns + np.rint(index * self._period_ns).astype(np.int64)
        temperature_c = self.ambient.temperature_c((time_ns - self._crane_start_ns) / 1e9)
        force_g = self._specific_force_g(time_ns)
        raw = self.part.counts(force_g, temperature_c, self._noise)
        saturated = mark_saturated(raw, *self.part.saturation_counts)
        self._newest_ns = int(time_ns[-1])
        for first in range(0, len(index), self._block_samples):
            block = slice(first, first + self._block_samples)
            block_c = round(float(temperature_c[block][-1]), 2)
            yield SampleBlock(time_ns[block], raw[block], block_c, self._lost, saturated=saturated[block])
            self._lost = 0

    def _specific_force_g(self, time_ns: NDArray[np.int64]) -> Array:
        """Return the specific force at the housing, on the rope or in the rigger's hands."""
        while self._orders:
            self._obey(self._orders.popleft(), int(time_ns[0]))
        time_s = (time_ns - self._crane_start_ns) / 1e9
        if self._rigger is not None:
            return self._rigger.specific_force_g(time_s)
        return self.crane.specific_force_m_s2(time_s) / self.crane.gravity_m_s2

    def _obey(self, up: Array | None, now_ns: int) -> None:
        if up is not None:
            self._rigger = self._rigger or Rigger(self._rigger_random)
            self._rigger.turn(up, (now_ns - self._crane_start_ns) / 1e9)
        elif self._rigger is not None:
            self._rigger = None
            self.crane = demo_crane(self._seed, *self._place_m, self.crane.gravity_m_s2, rest_s=REST_S)
            self._crane_start_ns = now_ns

    def _log_captions(self, block: SampleBlock) -> None:
        """Log what the crane begins to do within a block."""
        last_s = (int(block.time_ns[-1]) - self._crane_start_ns) / 1e9
        if self._rigger is not None:
            return
        for caption in self.crane.captions(last_s - self._block_samples * self._period_ns / 1e9, last_s):
            log.info("simulated crane: %s", caption)

    def _drop_samples(self, opened_ns: int, now_ns: int) -> None:
        """Continue with the newest complete block, and count the samples lost before it, once any was read."""
        newest = int((now_ns - opened_ns) / self._period_ns) - self._block_samples + 1
        if self._next > 0:
            self._lost = newest - self._next
            self._faults["overrun"] += 1
        self._next = newest
        self._shift_own_time(now_ns - int(self._ready[-1].time_ns[-1]))
        self._ready.clear()
        self._ready.extend(self._simulate(opened_ns))

    def _shift_own_time(self, absent_ns: int) -> None:
        """Shift the crane's own time by all but the last part of a long absence, which need not be simulated."""
        self._crane_start_ns += max(0, absent_ns - round(MAX_CATCH_UP_S * 1e9))


class Rigger:
    """Holds the attitude of the housing, as the direction that points up in its own axes."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._from, self._to, self._start_s = UPRIGHT, UPRIGHT, -TURN_S

    def turn(self, up: Array, time_s: float) -> None:
        """Begin to turn the housing at a time, so that a direction (3,), a unit vector, points up."""
        self._from = self._up(np.array([time_s]))[0]
        self._to = _unit(up + np.cross(self._random.normal(0.0, PLACEMENT_RAD, 3), up))
        self._start_s = time_s

    def specific_force_g(self, time_s: Array) -> Array:
        """Return the specific force in the housing's axes, shape (n, 3), at times (n,) after the last turn."""
        turning = (time_s < self._start_s + TURN_S)[:, None]
        return self._up(time_s) + SHAKE_G * turning * self._random.standard_normal((len(time_s), 3))

    def _up(self, time_s: Array) -> Array:
        """Return the direction that points up, shape (n, 3), on the great circle between the two faces."""
        across = self._to - np.dot(self._to, self._from) * self._from
        if np.linalg.norm(across) < 1e-6:  # the same face, or the opposite one by way of any other
            across = np.cross(self._from, np.roll(np.eye(3)[np.argmax(np.abs(self._from))], 1))
        angle_rad = np.arccos(np.clip(np.dot(self._to, self._from), -1.0, 1.0))
        share = np.clip((time_s - self._start_s) / TURN_S, 0.0, 1.0)
        turned_rad = (angle_rad * share * share * (3 - 2 * share))[:, None]
        up: Array = np.cos(turned_rad) * self._from + np.sin(turned_rad) * _unit(across)
        return up


def _unit(vector: Array) -> Array:
    result: Array = vector / np.linalg.norm(vector)
    return result
