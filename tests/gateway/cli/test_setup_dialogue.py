"""The questions of `plumbline setup` on sensors that do not identify themselves."""

import pytest

from gateway.cli.machine.setup_dialogue import _ask_kind
from gateway.configuration.loading import Answers


def say(monkeypatch: pytest.MonkeyPatch, *answers: str) -> None:
    """Type the answers to the questions that follow."""
    rest = list(answers)
    monkeypatch.setattr("builtins.input", lambda _question: rest.pop(0))


@pytest.mark.parametrize(
    ("said", "device"),
    [
        (["node", "7"], {"kind": "node", "port": "/dev/ttyUSB0", "node": 7}),
        (["aspp", "50001", "8"], {"kind": "aspp", "port": "/dev/ttyUSB0", "node": 50001, "range_g": 8}),
        (["aspp", "50001", "-8", "aspp", "50001", "2.5"], {"kind": "aspp", "node": 50001, "range_g": 2.5}),
        (["witmotion"], {"kind": "witmotion", "port": "/dev/ttyUSB0"}),
    ],
)
def test_each_kind_is_asked_for_what_has_no_default(
    said: list[str], device: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = Answers()
    say(monkeypatch, *said)
    _ask_kind(answers, {"port": "/dev/ttyUSB0"})
    assert device.items() <= answers.table["device"].items()


def test_a_serial_sensor_that_was_not_found_is_asked_for_its_port(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = Answers()
    say(monkeypatch, "node", "usb:0403:6015:DN01", "7")
    _ask_kind(answers, {})
    assert answers.table["device"] == {"kind": "node", "port": "usb:0403:6015:DN01", "node": 7}
    assert 'port = "usb:0403:6015:DN01"' in answers.to_toml()
