"""The recordings of a real gateway, read while it runs and after it was killed."""

import json
import signal
from pathlib import Path

import pytest

from tests.system.conftest import Plumbline, StartGateway
from tests.waiting import wait_until

CONFIGURATION = "[recorder]\nsegment_s = 5\n"


@pytest.mark.slow
def test_every_result_of_a_gateway_is_computed_again_to_the_byte(
    start_gateway: StartGateway, plumbline: Plumbline, tmp_path: Path
) -> None:
    gateway = start_gateway(CONFIGURATION, arguments=("--duration", "17"))
    wait_until(lambda: len(gateway.recordings) >= 2, "the second segment")
    live = plumbline("record", "info", gateway.data_dir, "--json", "-")
    assert live.returncode == 0, live.stderr
    assert len(json.loads(live.stdout)["files"]) >= 2
    assert plumbline("record", "export", gateway.data_dir, "--csv", tmp_path / "live.csv").returncode == 0
    code, _, error = gateway.wait()
    assert code == 0, error
    replayed = plumbline("record", "replay", gateway.data_dir, "--json", "-")
    result = json.loads(replayed.stdout)
    assert (replayed.returncode, result["differing"], result["notes"]) == (0, {}, [])
    assert result["compared"]["/motion"] > 140


@pytest.mark.slow
def test_recording_of_a_killed_gateway_is_read_and_replayed_as_it_is(
    start_gateway: StartGateway, plumbline: Plumbline
) -> None:
    gateway = start_gateway(CONFIGURATION)
    wait_until(lambda: len(gateway.recordings) >= 2, "the second segment")
    gateway.process.send_signal(signal.SIGKILL)
    gateway.wait()
    info = plumbline("record", "info", gateway.data_dir)
    assert info.returncode == 0, info.stderr
    assert "not closed: incomplete, or still being written" in info.stdout
    replayed = plumbline("record", "replay", gateway.data_dir)
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    assert " 0 differ (byte for byte)" in replayed.stdout
