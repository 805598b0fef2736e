"""What the gateway does not load at its start, because each costs a small board megabytes."""

import subprocess
import sys

LOADED_LATER = {"asyncio", "http.client", "jinja2", "matplotlib", "scipy", "ssl", "tomlkit"}


def test_the_gateway_starts_without_what_its_page_its_documents_and_time_stamps_need() -> None:
    code = "import sys, gateway.daemon.gateway; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert LOADED_LATER & set(loaded) == set()
