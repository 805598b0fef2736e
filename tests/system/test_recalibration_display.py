"""The display of a recalibration is no part of it: it may be interrupted or lose its connection."""

import signal
import subprocess
import sys

import pytest

from tests.system.bus_query import query_signed
from tests.system.conftest import ROOT, JoinBus, StartGateway
from tests.system.cut_line import Line
from tests.values import present
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

REMOTE = (sys.executable, "-m", "gateway", "remote")
CANCEL = b'{"id": "request-1", "by": "bob"}'


def test_ctrl_c_leaves_the_session_running(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    command = [*REMOTE, "recalibrate", "--connect", gateway.endpoint]
    follower = subprocess.Popen(
        [*command, "--by", "ann", "--housing-off-rope"], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert "recalibrate: collecting" in present(follower.stdout).readline()
    assert "poses" in present(follower.stdout).readline()
    follower.send_signal(signal.SIGINT)
    out, _ = follower.communicate(timeout=PATIENCE_S)
    assert "the session continues" in out
    again = subprocess.Popen([*command, "--follow"], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert " of 6 poses" in present(again.stdout).readline()  # the rigger goes on while the command starts
    ((accepted, _),) = query_signed(peer.session, "cancel", CANCEL, gateway.data_dir)
    assert accepted
    out, _ = again.communicate(timeout=PATIENCE_S)
    assert "rejected: cancelled by bob" in out
    assert again.returncode == 1


def test_the_display_survives_a_lost_connection(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    line = Line(gateway.endpoint)
    try:
        follower = subprocess.Popen(
            [*REMOTE, "recalibrate", "--by", "ann", "--housing-off-rope", "--connect", line.endpoint],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert "recalibrate: collecting" in present(follower.stdout).readline()
        assert "poses" in present(follower.stdout).readline()
        line.cut()
        while "no answer from the gateway" not in (said := present(follower.stdout).readline()):
            assert said
        ((accepted, _),) = query_signed(peer.session, "cancel", CANCEL, gateway.data_dir)
        assert accepted
        line.mend()
        out, _ = follower.communicate(timeout=PATIENCE_S)
        assert "rejected: cancelled by bob" in out
        assert follower.returncode == 1
    finally:
        line.close()
