"""The guides for the field: every message in them is one that the program prints, every file one that is installed."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
GUIDES = ("installation", "README", "recovery")
FOLDER = ROOT / "docs" / "guides" / "service"
PARTS = ("gateway", "devices")


def test_every_message_of_the_recovery_table_is_one_of_the_program() -> None:
    text = (FOLDER / "recovery.md").read_text()
    code = "\n".join(path.read_text() for part in PARTS for path in sorted((ROOT / part).rglob("*.py")))
    messages = [
        message
        for row in re.findall(r"^\| (.+?) \| .+ \| .+ \|$", text, re.MULTILINE)
        for message in re.findall(r"`([^`]+)`", row)
        if message != "install.sh"
    ]
    assert len(messages) > 5
    assert [message for message in messages if message not in code] == []


def test_every_file_that_the_guides_name_is_installed() -> None:
    script = (ROOT / "script" / "deb").read_text()
    for name in GUIDES:
        named = re.findall(r"/opt/plumbline/current/(deploy/[\w./-]+)", (FOLDER / f"{name}.md").read_text())
        assert [path for path in named if not (ROOT / path).exists()] == []
    assert "for part in config deploy" in script


def test_what_the_guide_says_of_limits_is_the_evidence() -> None:
    table = (
        (ROOT / "docs" / "evidence" / "motion.md").read_text().split("real_cranes: alerts -->")[1].split("<!-- end")[0]
    )
    header, _, *rows = (line.strip("| ").split(" | ") for line in table.split("\n") if line.startswith("|"))
    cells = [row[header.index("0.75 u")] for row in rows]
    found = [re.match(r"(\d+) of (\d+), ([\d.]+) s before; ([\d.]+) %", cell) for cell in cells]
    announced, of, before_s, false = zip(*(map(float, match.groups()) for match in found if match), strict=True)
    shares = [100 * each / total for each, total in zip(announced, of, strict=True)]
    said = (
        f"with levels of {rows[0][0]} to {rows[-1][0]}°, {min(shares):.0f} to {max(shares):.0f} %, "
        f"{min(before_s):g} to {max(before_s):g} s before (median); "
        f"trips without cause stood {min(false):g} to {max(false):g} % of the time"
    )
    assert said in " ".join((FOLDER / "installation.md").read_text().split())
