"""The guides for controllers: every register in their programs is the one of the table."""

import re
from pathlib import Path

import pytest

from gateway.bridge.modbus_server import NOT_KNOWN, REGISTERS
from gateway.bridge.plant_snapshot import LEVEL_CODES, STATE_CODES
from gateway.bridge.plant_values import PLANT_VALUES

FOLDER = Path(__file__).parents[3] / "docs" / "guides" / "integrator"
GUIDES = ("plc_siemens_s7", "plc_codesys")
REGISTER_OF = {value.name: value.register for value in PLANT_VALUES}


@pytest.mark.parametrize("name", GUIDES)
def test_every_register_is_that_of_the_value_beside_it(name: str) -> None:
    text = (FOLDER / f"{name}.md").read_text()
    lines = re.findall(r"^.*\bdata\[\d+\].*$", text, re.MULTILINE)
    assert len(lines) >= 7
    for line in lines:
        beside = line.rpartition("//")[2].strip()
        assert {int(number) for number in re.findall(r"\bdata\[(\d+)\]", line)} == {REGISTER_OF[beside]}, line
    assert f"word {REGISTER_OF['angle_u95_deg']}, `angle_u95_deg`" in text


@pytest.mark.parametrize("name", GUIDES)
def test_length_codes_and_the_number_for_not_known_are_those_of_the_map(name: str) -> None:
    text = (FOLDER / f"{name}.md").read_text()
    assert f"| 0, {REGISTERS} |" in text
    assert f"[0..{REGISTERS - 1}]" in text
    assert f"{NOT_KNOWN} means not known" in " ".join(text.split())
    assert "It is no safety function" in " ".join(text.split())
    assert re.search(r"T#2[sS]", text)
    assert STATE_CODES["fine"].number == LEVEL_CODES["normal"].number == 1
    assert (LEVEL_CODES["warn"].number, STATE_CODES["gateway gone"].number, STATE_CODES["link gone"].number) == (
        2,
        7,
        8,
    )
