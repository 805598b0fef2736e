"""Namespaces and processes: gateways, a router, a wire with faults, and receivers, each behind links that can be cut."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROUTER = "10.231.1.1"
WIRE = "10.231.2.1"
BUS_PORT, WIRE_PORT = 7447, 7500
GATEWAYS = ("crane-1", "crane-2", "crane-3")
RECEIVERS = {
    "direct": f"tcp/{WIRE}:{BUS_PORT}",
    "wire": f"tcp/{WIRE}:{WIRE_PORT}",
    "datagrams": f"udp/{WIRE}:{WIRE_PORT}",
}
CONFIGURATION = """
[rope]
length_m = 0.8
[housing]
position_m = 0.56
[device]
odr_hz = 100
block_samples = 10
seed = {seed}
[alerts]
warn_deg = 7.2
trip_deg = 7.2
clear_deg = 7.2
hold_s = 0
[page]
enabled = false
[recorder]
quota_mb = 200
"""
"""A short rope and no hysteresis: some 0.4 changes of alerts per second."""


def run(*command: str) -> None:
    """Run a command of the system. Raises `CalledProcessError`."""
    subprocess.run(command, check=True, capture_output=True)


@dataclass
class Site:
    """Everything that runs."""

    folder: Path
    real_time: bool = False
    """Gateways and observer have real-time priority, so that other work on this machine does not delay them."""
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        suffix = str(os.getpid())
        self.spaces = {name: f"pb-{name}-{suffix}" for name in ("gw", "rt", "rx")}
        self.links = {
            "gateways": (f"g{suffix}", ROUTER, "10.231.1.2", "gw"),
            "receivers": (f"r{suffix}", WIRE, "10.231.2.2", "rx"),
        }

    def lay(self) -> None:
        """Make the namespaces and the links between them."""
        for space in self.spaces.values():
            run("ip", "netns", "add", space)
            run("ip", "-n", space, "link", "set", "lo", "up")
        for name, near, far, space in self.links.values():
            run(
                "ip",
                "link",
                "add",
                f"{name}a",
                "netns",
                self.spaces["rt"],
                "type",
                "veth",
                "peer",
                f"{name}b",
                "netns",
                self.spaces[space],
            )
            run("ip", "-n", self.spaces["rt"], "addr", "add", f"{near}/24", "dev", f"{name}a")
            run("ip", "-n", self.spaces[space], "addr", "add", f"{far}/24", "dev", f"{name}b")
            run("ip", "-n", self.spaces[space], "link", "set", f"{name}b", "up")
            run("ip", "-n", self.spaces["rt"], "link", "set", f"{name}a", "up")

    def set_link(self, link: str, *, up: bool) -> None:
        """Cut a link, or mend it."""
        run("ip", "-n", self.spaces["rt"], "link", "set", f"{self.links[link][0]}a", "up" if up else "down")

    def start(self, name: str, space: str, arguments: Sequence[str], **environment: str) -> None:
        """Start a process in a namespace; its output goes to a file."""
        with (self.folder / f"{name}.log").open("ab") as output:
            self.processes[name] = subprocess.Popen(
                ["ip", "netns", "exec", self.spaces[space], *self._priority(space), sys.executable, *arguments],
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=output,
            )

    def _priority(self, space: str) -> list[str]:
        return ["chrt", "--rr", "1"] if self.real_time and space == "gw" else []

    def start_party(self, name: str) -> None:
        """Start a gateway, the router, the wire, a receiver or the observer by its name."""
        if name in GATEWAYS:
            number = GATEWAYS.index(name)
            config = self.folder / f"{name}.toml"
            config.write_text(CONFIGURATION.format(seed=number + 1))
            self.start(
                name,
                "gw",
                ["-m", "gateway", "run", "--quiet", "--config", str(config)],
                PLUMBLINE_GATEWAY__DATA_DIR=str(self.folder / name),
                PLUMBLINE_GATEWAY__CRANE=name,
                PLUMBLINE_BUS__LISTEN=json.dumps([f"tcp/127.0.0.1:{BUS_PORT + number}"]),
                PLUMBLINE_BUS__CONNECT=json.dumps([f"tcp/{ROUTER}:{BUS_PORT}"]),
            )
        elif name == "router":
            endpoints = [f"{protocol}/0.0.0.0:{BUS_PORT}" for protocol in ("tcp", "udp")]
            self.start(name, "rt", [str(ROOT / "tests/alert_campaign/router.py"), *endpoints])
        elif name == "proxy":
            addresses = [f"{WIRE}:{WIRE_PORT}", f"{WIRE}:{BUS_PORT}"]
            self.start(name, "rt", [str(ROOT / "tests/alert_campaign/proxy.py"), *addresses])
        elif name == "observer":
            endpoints = [f"tcp/127.0.0.1:{BUS_PORT + number}" for number in range(len(GATEWAYS))]
            self.start(
                name, "gw", ["-m", "tests.alert_campaign.observer", str(self.folder / "observed.jsonl"), *endpoints]
            )
        else:
            self.start(name, "rx", ["-m", "tests.alert_campaign.consumer", RECEIVERS[name], str(self.log_of(name))])

    def log_of(self, receiver: str) -> Path:
        """Return the file in which a receiver notes its events."""
        return self.folder / f"received-{receiver}.jsonl"

    def tell_wire(self, fault: str, value: float = 1.0) -> None:
        """Change a fault of the wire."""
        pipe = self.processes["proxy"].stdin
        assert pipe is not None
        pipe.write(f"{fault} {value}\n".encode())
        pipe.flush()

    def restart(self, name: str) -> None:
        """Kill a process and start it again."""
        self.kill(name)
        self.start_party(name)

    def kill(self, name: str, how: signal.Signals = signal.SIGKILL) -> None:
        """End a process."""
        process = self.processes[name]
        process.send_signal(how)
        process.wait()

    def signal(self, name: str, what: signal.Signals) -> None:
        """Send a signal: `ip netns exec` has replaced itself with the program."""
        self.processes[name].send_signal(what)

    def clear(self) -> None:
        """End everything and remove the namespaces."""
        for process in self.processes.values():
            process.kill()
            process.wait()
        for space in self.spaces.values():
            subprocess.run(["ip", "netns", "del", space], check=False, capture_output=True)
