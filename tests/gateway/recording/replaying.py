"""The command `record replay` with its result as JSON."""

import json
from pathlib import Path
from typing import Any

import pytest

from gateway.cli.main import main


def replay(folder: Path, capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, dict[str, Any]]:
    """Exit code and JSON."""
    capsys.readouterr()
    code = main(["record", "replay", str(folder), "--json", "-", *map(str, arguments)])
    return code, json.loads(capsys.readouterr().out)
