"""The threads of a gateway are those that the architecture draws and lists, with the bounds of their queues."""

import re
from pathlib import Path

import pytest

from tests.system.conftest import ROOT, JoinBus, StartGateway
from tests.waiting import wait_until

pytestmark = pytest.mark.slow
TOML = """
[relay]
kind = "command"
command = ["/bin/true"]
[recorder]
time_stamp_authority = "http://127.0.0.1:9"
"""
SECTION = (
    (ROOT / "docs" / "development" / "architecture.md").read_text().partition("## Threads\n")[2].partition("\n## ")[0]
)
CALLS_BACK = "pyo3-closure"
"""In the name of the threads from which the library of the bus calls back."""


def listed() -> dict[str, str]:
    """The bound of the queue of each thread in the table; "-": it has none of its own."""
    rows = re.findall(r"^\| ([\w, -]+) \| .+ \| (-|\d+) \| .+ \|$", SECTION, re.MULTILINE)
    return {name: bound for names, bound in rows for name in names.split(", ")}


def test_the_threads_that_run_are_those_of_the_architecture(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    path = tmp_path / "threads"
    gateway = start_gateway(TOML, page=True, program=("tests.system.named_threads", str(path)))
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health", lambda message: message["recording"])
    wait_until(lambda: "page-receive" in path.read_text(), "the page")
    assert gateway.stop()[0] == 0
    lines = [line.split("\t") for line in path.read_text().splitlines() if CALLS_BACK not in line]
    assert {**dict(lines), "main": "-"} == listed()


def test_every_thread_of_the_table_is_drawn() -> None:
    assert set(re.findall(r'\(\["([\w-]+)"\]\)', SECTION)) == set(listed())
