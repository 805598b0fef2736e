"""Parts that stand in for hardware, and tables of recordings, for the tests of this folder."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.devices.i2c.adxl355_rig import Rig
from tests.devices.serial.serial_peer import Peer, SetClock
from tests.devices.tables.table_lines import WriteTable


@pytest.fixture
def rig() -> Callable[..., Rig]:
    """Makes an ADXL355 at the bus with its driver."""
    return Rig


@pytest.fixture
def table(tmp_path: Path) -> WriteTable:
    def write(*lines: str, end: str = "\n", name: str = "recording.csv") -> Path:
        path = tmp_path / name
        path.write_text("\n".join(lines) + end, encoding="utf-8")
        return path

    return write


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    made = Peer(tmp_path / "sensor")
    yield made
    made.close()


@pytest.fixture
def clock() -> SetClock:
    return SetClock()
