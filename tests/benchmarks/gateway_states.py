"""How soon a consumer knows that sensor, gateway or link are gone, and that they are back: real processes, ten times each."""

import json
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from gateway.gateway_state import GatewayState
from tests.benchmarks.alert_latency import CHATTERING
from tests.system.bus_router import BusRouter
from tests.system.conftest import RunningGateway
from tests.system.test_alert_delivery import Follower, Radio

RUNS = 10
RADIO = '[device]\nkind = "witmotion"\nport = "{port}"\n[rope]\nlength_m = 6\n[housing]\nposition_m = 4\n'


def main() -> None:
    """Print the times, in seconds."""
    print(f"states at a consumer: {RUNS} times each, s, median (most)")
    with tempfile.TemporaryDirectory() as folder:
        _gateway_and_link(Path(folder))
    with tempfile.TemporaryDirectory() as folder:
        _sensor(Path(folder))


def _gateway_and_link(folder: Path) -> None:
    router = BusRouter()
    environment = {"PLUMBLINE_BUS__CONNECT": json.dumps([router.endpoint])}
    gateway = RunningGateway(folder, CHATTERING, environment=environment)
    follower = Follower(router)
    follower.until_state(GatewayState.FINE)
    begin: dict[str, tuple[Callable[[], object], GatewayState, Callable[[], object]]] = {
        "gateway hangs (SIGSTOP)": (
            lambda: gateway.process.send_signal(signal.SIGSTOP),
            GatewayState.GATEWAY_GONE,
            lambda: gateway.process.send_signal(signal.SIGCONT),
        ),
        "router is killed": (router.kill, GatewayState.LINK_GONE, router.start),
        "link falls silent (SIGSTOP of the router)": (
            lambda: router.signal(signal.SIGSTOP),
            GatewayState.LINK_GONE,
            lambda: router.signal(signal.SIGCONT),
        ),
    }
    for name, (break_it, state, mend) in begin.items():
        _report(name, follower, break_it, state, mend, GatewayState.FINE)
    times = []
    for _ in range(RUNS):
        times.append(_time_to(follower, gateway.process.kill, GatewayState.GATEWAY_GONE))
        gateway.wait()
        gateway = RunningGateway(folder, CHATTERING, environment=environment)
        follower.until_state(GatewayState.FINE)
    _print("gateway is killed", times)
    follower.receiver.close()
    gateway.stop()
    router.kill()


def _sensor(folder: Path) -> None:
    router, radio = BusRouter(), Radio()
    environment = {"PLUMBLINE_BUS__CONNECT": json.dumps([router.endpoint])}
    gateway = RunningGateway(folder, RADIO.format(port=radio.port), environment=environment)
    follower = Follower(router)
    follower.until_state(GatewayState.UNCALIBRATED)
    _report(
        "sensor falls silent",
        follower,
        radio.talks.clear,
        GatewayState.SENSOR_GONE,
        radio.talks.set,
        GatewayState.UNCALIBRATED,
    )
    follower.receiver.close()
    gateway.stop()
    radio.close()
    router.kill()


def _report(
    name: str,
    follower: Follower,
    break_it: Callable[[], object],
    state: GatewayState,
    mend: Callable[[], object],
    after: GatewayState,
) -> None:
    gone, back = [], []
    for _ in range(RUNS):
        gone.append(_time_to(follower, break_it, state))
        back.append(_time_to(follower, mend, after))
        time.sleep(0.5)
    _print(name, gone)
    _print("  mended", back)


def _time_to(follower: Follower, act: Callable[[], object], state: GatewayState) -> float:
    begin_s = time.monotonic()
    act()
    follower.until_state(state)
    return time.monotonic() - begin_s


def _print(name: str, times: list[float]) -> None:
    print(f"  {name:<44} {sorted(times)[len(times) // 2]:5.2f} ({max(times):5.2f})", flush=True)
