"""Texas Instruments ADS1115: 16-bit analogue-to-digital converter with four inputs, its registers and decoding.

Registers and tables by the data sheet SBAS444D, sections 7.5 (timing), 9.3 (inputs, ranges, data rate) and 9.6 (registers).
Registers and bits agree with Adafruit's library. Not confirmed by a second source: the time to wake up.
"""

from dataclasses import dataclass

from devices.clock import Clock
from devices.errors import ConfigurationReadBackError, IdentityError, TransferError
from devices.i2c.bus import I2cPart

CONVERSION, CONFIG, LO_THRESH, HI_THRESH = 0x00, 0x01, 0x02, 0x03
THRESHOLD_DEFAULTS = b"\x80\x00", b"\x7f\xff"
ADDRESSES = (0x48, 0x49, 0x4A, 0x4B)
START = READY = 0x8000
SINGLE_ENDED = 0x4000
"""Input 0 against ground; each further input adds 0x1000."""
RANGE_4_096_V, SINGLE_SHOT, RATE_860_HZ, COMPARATOR_OFF = 0x0200, 0x0100, 0x00E0, 0x0003
VOLTS_PER_UNIT = 4.096 / 32768
"""Step of the range of 4.096 V (data sheet, section 9.6)."""
N_INPUTS = 4
"""Definition: of the part (data sheet)."""
CONVERSION_S = 1 / 860
"""Nominal at the highest data rate; the oscillator is right to 10 % (data sheet, section 7.5)."""
WAKE_UP_S = 25e-6
"""Data sheet, see above."""
CONVERSION_POLL_S = 1e-4
"""Pause between two looks for the end of a conversion. Basis: a choice; less than a tenth of a conversion, about a transfer."""
MAX_CONVERSION_S = 0.005
"""Basis: a choice; four conversions, so that a slow oscillator passes and a part that hangs shows."""


@dataclass(frozen=True, slots=True)
class Conversion:
    """The voltage of one input, averaged over a conversion."""

    middle_ns: int
    volts: float


def identify(part: I2cPart) -> None:
    """Check the threshold registers, which keep their defaults: the part has no identity. Raises `IdentityError`."""
    found = part.read(LO_THRESH, 2), part.read(HI_THRESH, 2)
    if found != THRESHOLD_DEFAULTS:
        raise IdentityError(
            f"{part}: thresholds read {found[0].hex().upper()} {found[1].hex().upper()}, an ADS1115 has 8000 7FFF after"
            " power-on; name the right address, or power-cycle the part"
        )


def convert(part: I2cPart, clock: Clock, channel: int) -> Conversion:
    """Convert one input. Raises `TransferError`, and `ConfigurationReadBackError` when the settings are lost meanwhile."""
    settings = SINGLE_ENDED | channel << 12 | RANGE_4_096_V | SINGLE_SHOT | RATE_860_HZ | COMPARATOR_OFF
    part.write(CONFIG, *(settings | START).to_bytes(2, "big"))
    start_ns = clock.now_ns()
    clock.sleep_s(WAKE_UP_S + CONVERSION_S)
    while not _is_ready(part, settings):
        if clock.now_ns() - start_ns > MAX_CONVERSION_S * 1e9:
            raise TransferError(f"{part}: a conversion does not end; power-cycle the converter")
        clock.sleep_s(CONVERSION_POLL_S)
    units = int.from_bytes(part.read(CONVERSION, 2), "big", signed=True)
    return Conversion(start_ns + round((WAKE_UP_S + CONVERSION_S / 2) * 1e9), units * VOLTS_PER_UNIT)


def _is_ready(part: I2cPart, settings: int) -> bool:
    found = int.from_bytes(part.read(CONFIG, 2), "big")
    if found & ~READY != settings:
        found = int.from_bytes(part.read(CONFIG, 2), "big")  # one disturbed reading is tolerated
    if found & ~READY != settings:
        raise ConfigurationReadBackError(
            f"{part}: register CONFIG ({CONFIG:#04x}) reads {found:#06x}, not {settings:#06x}; the part has lost its"
            " configuration, check its supply and cable"
        )
    return bool(found & READY)
