"""The command `record replay` with its result as JSON."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from gateway.cli.main import main


def replay(folder: Path, capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, dict[str, Any]]:
    """Exit code and JSON; what is printed beside it stays in `capsys`."""
    capsys.readouterr()
    with TemporaryDirectory() as name:
        out = Path(name) / "result.json"
        code = main(["record", "replay", str(folder), "--json", str(out), *map(str, arguments)])
        return code, json.loads(out.read_text())
