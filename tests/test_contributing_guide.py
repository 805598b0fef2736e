"""CONTRIBUTING.md names exactly the files of a task: a copy of the tree is changed by it, and works with real parts."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gateway.languages import LANGUAGES

ROOT = Path(__file__).parents[1]
COPIED = ("config", "devices", "docs", "gateway", "tests")


class Tree:
    """A copy of the tree with the files that were changed in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.changed: set[str] = set()
        for name in COPIED:
            shutil.copytree(ROOT / name, folder / name)
        shutil.copy2(ROOT / "pyproject.toml", folder)

    def insert(self, file: str, text: str, *, before: str) -> None:
        """Insert text before the only place of another."""
        content = (self.folder / file).read_text(encoding="utf-8")
        assert content.count(before) == 1, f"{file}: {before!r} is there {content.count(before)} times"
        self.write(file, content.replace(before, text + before))

    def write(self, file: str, content: str) -> None:
        (self.folder / file).write_text(content, encoding="utf-8")
        self.changed.add(file)

    def copy(self, file: str, to: str, changes: dict[str, str]) -> None:
        """Write another file with some words replaced."""
        content = (ROOT / file).read_text(encoding="utf-8")
        for word, other in changes.items():
            assert word in content, f"{file}: no {word!r}"
            content = content.replace(word, other)
        self.write(to, content)

    def python(self, *arguments: str) -> None:
        """Run Python in the copy."""
        done = subprocess.run(
            [sys.executable, *arguments], cwd=self.folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    return Tree(tmp_path / "tree")


def named_files(section: str, languages: tuple[str, ...] = LANGUAGES, **places: str) -> set[str]:
    """Return the files that a section of the guide names, with its placeholders filled."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    body = text.split(f"\n## {section}\n")[1].split("\n## ")[0]
    files = re.findall(r"^\| `([^`]+)` \|", body, re.MULTILINE)
    filled = [re.sub(r"<(\w+)>", lambda found: places.get(found[1], found[0]), file) for file in files]
    return {file.replace("<language>", language) for file in filled for language in languages}


RULE = """
def _sway_reading(evaluation: Evaluation) -> Reading | None:
    motion = evaluation.motion
    if motion.angle_rad is None or motion.u_rad is None:
        return None
    return Reading.of(motion.angle_rad, motion.u_rad)


def _sway_limits(section: "AlertsSection") -> Limits:
    trip_rad = math.radians(section.sway_trip_deg)
    return Limits(trip_rad=trip_rad, clear_rad=trip_rad / 2, hold_s=section.hold_s)


"""
RULE_CHECK = """
import sys
from pathlib import Path
from gateway.incident.course_builder import CourseBuilder
from gateway.page.metrics import render
from gateway.page.metrics import gateway_families
from gateway.page.verdict import PageEvidence
from gateway.recording.reading.recording_file import open_recording
from tests.gateway.recorded_crane import record_crane

found = []
for path in record_crane(Path(sys.argv[1]), 8.0).files:
    file = open_recording(path)
    found += [(each.log_time_ns, file.decode(each)) for each in file.messages() if each.topic == "/alert"]
changes = [(time_ns, alert) for time_ns, alert in found if alert.rule == "sway"]
assert [alert.event for _, alert in changes][:2] == ["changed", "raised"], changes
time_ns, raised = changes[1]
assert raised.limit_deg == 0.5 and raised.change.startswith("sway raised to trip"), raised
metrics = render(gateway_families(PageEvidence(True, {"alert": raised}, {"alert": 0.0}, 1.0)))
assert 'plumbline_alert_rule_level{rule="sway",level="trip"} 1' in metrics, metrics
builder = CourseBuilder(time_ns)
builder.add(time_ns, raised)
assert builder.course(time_ns, time_ns).alert_levels["sway"].state == ("trip",)
"""


@pytest.mark.slow
def test_an_alert_rule_changes_the_files_of_the_guide_and_is_raised_and_recorded(tree: Tree) -> None:
    key = '    sway_trip_deg: float = Field(0.5, gt=0, lt=90, description="trip level of the present angle")\n'
    tree.insert("gateway/configuration/model.py", key, before="    stale_s: float = Field(1.0, ge=0.2, le=60")
    rules = "gateway/pipeline/alert_rules.py"
    tree.insert(rules, RULE, before='SWING = AlertRule("swing"')
    tree.insert(rules, '    AlertRule("sway", _sway_limits, _sway_reading),\n', before=")\nRULE_NAMES")
    for language in LANGUAGES:
        texts = '  "rule_sway": "Sway", "sway_alarm": "The rope is at {angle}; {limit}.",\n'
        tree.insert(f"gateway/languages/{language}.json", texts, before='  "decimal_mark"')
    row = "| `sway` | the present angle | `sway_trip_deg` |\n"
    tree.insert("docs/reference/messages.md", row, before="| `calibration` | the [drift watch]")
    assert tree.changed == named_files("Add an alert rule")
    tree.python("-c", RULE_CHECK, str(tree.folder / "recordings"))


TOPIC_CHECK = """
import json
import sys
from pathlib import Path
from gateway.cli.main import main
from gateway.messages.motion import Echo
from gateway.recording.reading.recording_file import open_recording
from tests.gateway.recording.recorded_crane import RecordedCrane
from tests.test_docs import test_topic_table_is_the_codes

folder = Path(sys.argv[1])
crane = RecordedCrane(folder)
crane.record(5)
crane.close()
(path,) = folder.glob("*.mcap")
file = open_recording(path)
echoes = [file.decode(each) for each in file.messages() if each.topic == "/echo"]
assert len(echoes) == 50 and all(isinstance(each, Echo) and each.verdict for each in echoes), echoes
assert "plumbline.Echo" in {schema.name for schema in file.schemas.values()}
assert main(["record", "replay", str(folder), "--json", str(folder / "replay.json")]) == 0
result = json.loads((folder / "replay.json").read_text())
assert result["equal"] and result["compared"]["/echo"] == 50, result
test_topic_table_is_the_codes()
"""
MESSAGE = """

@dataclass(frozen=True, slots=True, kw_only=True)
class Echo(Message):
    verdict: Annotated[str, Field(description="the verdict of the condition once more")]
"""


@pytest.mark.slow
def test_a_topic_changes_the_files_of_the_guide_and_is_recorded_and_replayed(tree: Tree) -> None:
    motion = (tree.folder / "gateway/messages/motion.py").read_text(encoding="utf-8")
    tree.write("gateway/messages/motion.py", motion + MESSAGE)
    topics, pipeline = "gateway/topics.py", "gateway/pipeline/pipeline.py"
    tree.insert(topics, '        Topic("echo", Echo, "10 Hz", recomputed=True),\n', before='        Topic("mark",')
    tree.insert(
        topics,
        "from gateway.messages.motion import Echo\n",
        before="\n\n@dataclass(frozen=True, slots=True)\nclass Topic",
    )
    sent = '            yield self._message("echo", now, lambda head: Echo(**head, verdict=self._condition.verdict))\n'
    tree.insert(pipeline, sent, before="        if swing_due:\n")
    tree.insert(pipeline, "from gateway.messages.motion import Echo\n", before="from gateway.packing import pack\n")
    row = "| echo | plumbline.Echo | 10 Hz | yes | yes |\n"
    tree.insert("docs/reference/messages.md", row, before="| mark | plumbline.Mark |")
    assert tree.changed == named_files("Add a topic", subject="motion")
    tree.python("-c", TOPIC_CHECK, str(tree.folder / "recordings"))


CHIP_CHECK = """
import sys
from pathlib import Path
import numpy as np
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from gateway.configuration.loading import load
from gateway.daemon.sampling.device_search import search_sensors
from tests.devices.i2c.chip_bus import ChipBus
from tests.devices.i2c.i2c_chip import FakeClock
from tests.devices.i2c.lis9_chip import Lis9Chip

clock = FakeClock()
bus = ChipBus(clock, Lis9Chip(clock, signal=lambda _: (0.1, -0.2, 0.95)))
folder = Path(sys.argv[1])
folder.mkdir()
(folder / "i2c-1").touch()
(sensor,) = search_sensors(clock, bus, folder)
assert sensor.settings == {"kind": "lis9", "bus": 1, "address": 0x18}, sensor
section = load(Path("config/lis9.toml"), {}).device
device = FifoAccelerometer(section.chip(section.odr_hz, section.range_g), section.bus, section.address, clock=clock, open_bus=bus)
info = device.open()
blocks = [block for block in (device.read() for _ in range(20)) if block is not None]
force_g = np.concatenate([block.raw for block in blocks]) / info.units_per_g
assert info.device_id.startswith("lis9-") and np.abs(force_g - [0.1, -0.2, 0.95]).max() < 1e-3, (info, force_g)
"""
CHIP_KIND = r"""LIS9_KIND = ChipKind(
    part="LIS9",
    description="LIS9 over I2C.",
    driver="lis9:Lis9",
    identities=(Identity("LIS9", (0x18, 0x19), 0x0F, b"\x39"),),
    address_text="0x18, or 0x19 with the SA0 pin high",
    rates_hz=LIS2DW12_KIND.rates_hz,
    rates_text=LIS2DW12_KIND.rates_text,
)
"""
OTHER_CHIP = {"LIS2DW12": "LIS9", "Lis2dw12": "Lis9"}


@pytest.mark.slow
def test_a_chip_changes_the_files_of_the_guide_and_is_found_and_read(tree: Tree) -> None:
    tree.copy("devices/i2c/lis2dw12.py", "devices/i2c/lis9.py", OTHER_CHIP)
    tree.insert("devices/i2c/chips.py", CHIP_KIND, before="MPU9250_KIND = ChipKind(")
    tree.insert("devices/i2c/chips.py", "        LIS9_KIND,\n", before="        MPU9250_KIND,\n")
    tree.copy("config/lis2dw12.toml", "config/lis9.toml", {"lis2dw12": "lis9", "LIS2DW12": "LIS9"})
    row = "| LIS9 | VDD and VDD_IO, CS too | GND | SDA | SCL | 0x18; 0x19 with SA0 at VDD_IO |\n"
    tree.insert("docs/guides/service/installation.md", row, before="| MPU-9250, MPU-6050 |")
    model = {"Lis2dw12": "Lis9", '"lis2dw12"': '"lis9"', "0x0F: 0x44": "0x0F: 0x39"}
    tree.copy("tests/devices/i2c/lis2dw12_chip.py", "tests/devices/i2c/lis9_chip.py", model)
    rig = "tests/devices/i2c/part_rig.py"
    tree.insert(rig, "    lis9_chip.PART,\n", before="    mpu9250_chip.MPU9250,\n")
    tree.insert(rig, "from tests.devices.i2c import lis9_chip\n", before="from tests.devices.i2c.fifo_rig import")
    assert tree.changed == named_files("Add a chip", chip="lis9")
    tree.python("-c", CHIP_CHECK, str(tree.folder / "dev"))
    checks = "lis9 and (data_sheet or saturated or refused or every_range or moves) or every_kind or known or no_others"
    paths = ("tests/devices/i2c/test_parts.py", "tests/devices/i2c/test_self_test.py", "tests/test_config_examples.py")
    tree.python("-m", "pytest", "-q", "-m", "not slow", "-k", checks, "-p", "no:cacheprovider", *paths)


LANGUAGE_CHECK = """
from gateway.cli.main import parser
from gateway.configuration.loading import validate
from gateway.page.http_server import static_routes

assert validate({"page": {"language": "nl"}}, "test").page.language == "nl"
assert parser().parse_args(["fleet", "page", "--language", "nl"]).language == "nl"
assert "/language.js" in {route.path for route in static_routes("index.html", "nl")}
"""


@pytest.mark.slow
def test_a_language_is_one_file(tree: Tree) -> None:
    tree.copy("gateway/languages/de.json", "gateway/languages/nl.json", {})
    assert tree.changed == named_files("Add a language", languages=("nl",))
    tree.python("-c", LANGUAGE_CHECK)


def test_the_files_of_a_field_of_motion_exist() -> None:
    files = named_files("Add a field of `/motion`")
    assert len(files) == 4
    assert [file for file in files if not (ROOT / file).is_file()] == []
