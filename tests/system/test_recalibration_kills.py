"""A kill or a power cut at points all along a session; `python -m tests.benchmarks.killed_session` takes every point."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.values import present

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]


def test_a_complete_record_is_in_force_after_every_kill() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.killed_session", "29"],
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    kills = int(present(re.match(r"\d+", done.stdout)).group())
    assert kills >= 20
