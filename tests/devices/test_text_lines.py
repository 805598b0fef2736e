"""The example of the how-to page on serial sensors, on a pseudo-terminal."""

import re
from pathlib import Path
from typing import Any

import pytest

from devices.errors import DeviceError
from tests.devices.serial.serial_peer import Peer, SetClock
from tests.values import present

PAGE = Path(__file__).parents[2] / "docs" / "development" / "add_a_serial_sensor.md"


def test_the_example_of_the_page_reads_a_port(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    names: dict[str, Any] = {"__name__": "my_package"}
    exec(compile(code, "my_package", "exec"), names)
    peer = Peer(tmp_path / "port")
    device = names["open_text"](str(peer.name), SetClock())
    assert device.open().device_id == "text-port"
    peer.send(b"12,3\n" + b"1,-2,1000\n" * 8)
    block = present(device.read())
    assert block.raw.tolist() == [[1, -2, 1000]] * len(block)
    assert device.faults == {"bad_lines": 1, "disconnect": 0}

    def listen() -> None:
        for _ in range(5):
            peer.send(b"?" * 1000)
            device.read()

    with pytest.raises(
        DeviceError, match=r"no line of three numbers in .* bytes at 115200 baud; check the baud rate, and"
    ):
        listen()
    device.close()
    peer.unplug()
