"""What the gateway and its page do not load at their start, because each costs a small board megabytes or time."""

import subprocess
import sys
from functools import cache

LOADED_LATER = {"asyncio", "http.client", "jinja2", "matplotlib", "scipy", "ssl", "tomlkit"}
LOADED_WHERE_CONFIGURED = {"gateway.daemon.outputs.relay_worker", "gateway.daemon.storage.time_stamper"}
MOST_OWN_MODULES = 190
"""Modules of this repository that are loaded, packages included; it only falls, and 150 are wanted."""


@cache
def loaded_modules(start: str = "gateway.daemon.gateway") -> frozenset[str]:
    code = f"import sys, {start}; print(*sys.modules)"
    return frozenset(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    )


def test_the_gateway_starts_without_what_its_page_its_documents_and_time_stamps_need() -> None:
    assert LOADED_LATER & loaded_modules() == set()


def test_the_gateway_starts_without_the_parts_that_are_not_configured() -> None:
    assert LOADED_WHERE_CONFIGURED & loaded_modules() == set()


def test_the_gateway_loads_no_more_modules_of_its_own_than_before() -> None:
    own = [name for name in loaded_modules() if name.partition(".")[0] in ("gateway", "devices")]
    assert len(own) <= MOST_OWN_MODULES, f"{len(own)} modules; load later what only some configurations need"


def test_the_page_starts_without_the_configuration_which_it_does_not_read() -> None:
    assert "gateway.configuration.model" not in loaded_modules("gateway.page.server")
