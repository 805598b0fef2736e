"""The documentation is a site with search, built without a warning."""

import subprocess
from pathlib import Path

import pytest

SITE = Path(__file__).parents[2] / "script" / "site"


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    ended = subprocess.run([SITE, str(tmp_path)], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "Plumbline" in (tmp_path / "index.html").read_text()
    assert (tmp_path / "searchindex.js").exists()
