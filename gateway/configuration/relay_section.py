"""The section `[relay]`: an output that is energised while all is well."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from gateway.configuration.section import Section


class NoRelay(Section):
    """No relay."""

    kind: Literal["none"] = "none"


class RelaySection(Section):
    """The keys that every kind of relay has."""

    drop_at: Literal["warn", "trip"] = Field("trip", description="alert level from which the relay drops")
    unknown_s: float = Field(
        5.0, ge=0, le=3600, description="the relay drops when the swing or lean is not known for longer than this"
    )
    ignore_acknowledged: bool = Field(
        False,
        description="an incident that a person has acknowledged no longer drops the relay: for a horn, not for a lamp",
    )
    watchdog_s: float = Field(
        3.0, ge=1.5, le=60, description="the relay drops when the gateway has judged no alert for this long"
    )


class CommandRelay(RelaySection):
    """A relay that a program switches."""

    kind: Literal["command"]
    command: list[str] = Field(
        min_length=1, description='program and arguments; "energise" or "release" is appended; exit code 0: done'
    )
    command_timeout_s: float = Field(1.0, gt=0, le=10, description="a command that takes longer has failed")
    repeat_s: float = Field(
        10.0, ge=1, le=3600, description="interval at which the command is repeated while nothing changes"
    )


class GpioRelay(RelaySection):
    """A relay on a GPIO line, through the kernel's character device; needs the extra `relay`."""

    kind: Literal["gpio"]
    chip: Path = Field(Path("/dev/gpiochip0"), description="character device of the GPIO chip")
    line: int = Field(ge=0, le=1023, description="offset of the line on the chip, not the pin of the connector")
    active_low: bool = Field(False, description="true: the relay is energised by a low level")
    pulse_hz: float | None = Field(
        None,
        gt=0,
        le=50,
        description="energised is a square wave of this frequency, for a relay with a watchdog of its own",
    )


AnyRelay = Annotated[
    NoRelay | CommandRelay | GpioRelay,
    Field(discriminator="kind", description="an output that is energised while all is well"),
]
