"""A gateway offers what its own recordings show of its sensor, and a person puts it in force: real processes, planted truth."""

from pathlib import Path

import numpy as np
import pytest

from gateway.calibration.acceptance import add_content_hash
from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import CalibrationStore
from gateway.configuration.device_sections import ReplayDevice
from gateway.daemon.sampling.replay_source import open_replay
from tests.clocks import SleeplessClock
from tests.gateway.bench.intervals.temperature import six_position_record
from tests.gateway.bench.planted.thermal import Disturbances, ThermalTruth, Values, draw_truth, service_at_rest
from tests.system.conftest import JoinBus, Plumbline, StartGateway

pytestmark = pytest.mark.slow

DURATION_S = 300.0
DEVICE = '[device]\nkind = "replay"\nspeed = {speed}\npath = "{path}"\n'
DEVICE += 'unit = "g"\naxis_columns = ["acc_x", "acc_y", "acc_z"]\ntime_column = "time"\n'
TOML = DEVICE + "[housing]\nposition_m = 5\n[recorder]\nsegment_s = 100\n"


@pytest.fixture
def service(tmp_path: Path) -> tuple[Path, CalibrationRecord, float]:
    """Service of a planted sensor as a table, its record, and the change of the axis along its rope, mg/°C."""
    random = np.random.default_rng(28)
    truth = draw_truth(random)
    time_s, raw_g, thermometer_c = service_at_rest(random, truth, np.zeros(2), DURATION_S, Disturbances())
    slopes, scales = truth.mean_slopes((25.0, 25.0))
    path, record = write_service(tmp_path, truth, np.column_stack([time_s, raw_g, thermometer_c]))
    return path, record, float(slopes[2] + 10 * scales[2])


def write_service(folder: Path, truth: ThermalTruth, columns: Values) -> tuple[Path, CalibrationRecord]:
    """Write readings as a table, and return it with the record of the device that it is when it is played."""
    path = folder / "service.csv"
    header = ["time", "acc_x", "acc_y", "acc_z", "temperature"][: columns.shape[1]]
    np.savetxt(path, columns, "%.6f", ",", header=",".join(header), comments="")
    device = ReplayDevice(
        kind="replay", path=path, unit="g", axis_columns=("acc_x", "acc_y", "acc_z"), time_column="time"
    )
    device_id = open_replay(device, 32, SleeplessClock()).info.device_id
    record = add_content_hash(six_position_record(truth).model_dump(mode="json") | {"device_id": device_id})
    return path, record


def config_of(folder: Path, *lines: str) -> Path:
    path = folder / "site.toml"
    path.write_text("\n".join([f'[gateway]\ndata_dir = "{folder / "data"}"', *lines]))
    return path


def put_in_force(store: CalibrationStore, record: CalibrationRecord) -> None:
    store.add(record)
    store.put_in_force(record.id, by="ann", reason="", request="1", time_utc=record.created_utc)


def test_nothing_is_offered_without_a_record_or_temperatures(
    start_gateway: StartGateway, plumbline: Plumbline, tmp_path: Path
) -> None:
    random = np.random.default_rng(29)
    truth = draw_truth(random)
    time_s, raw_g, _ = service_at_rest(random, truth, np.zeros(2), 20.0, Disturbances())
    path, record = write_service(tmp_path, truth, np.column_stack([time_s, raw_g]))
    config = config_of(tmp_path)
    for said in ("no record is in force", "no rest with a temperature"):
        assert start_gateway(TOML.format(speed=0, path=path)).wait()[0] == 0
        done = plumbline("calibrate", "propose", "--config", config)
        assert done.returncode == 1, done.stdout
        assert said in done.stderr
        put_in_force(CalibrationStore(tmp_path / "data", record.device_id), record)


def test_an_offer_from_own_recordings_is_shown_and_changes_nothing_until_a_person_puts_it_in_force(
    service: tuple[Path, CalibrationRecord, float],
    start_gateway: StartGateway,
    join_bus: JoinBus,
    plumbline: Plumbline,
    tmp_path: Path,
) -> None:
    path, record, mg_per_c = service
    store = CalibrationStore(tmp_path / "data", record.device_id)
    put_in_force(store, record)
    code, _, err = start_gateway(TOML.format(speed=0, path=path)).wait()
    assert code == 0, err

    gateway = start_gateway(TOML.format(speed=1, path=path))
    peer = join_bus(gateway.endpoint)
    assert peer.wait_for("health", lambda health: health["calibration_id"] == record.id)["offer"] is None
    config = config_of(tmp_path, "[bus]", f"listen = ['{gateway.endpoint}']")
    offered = plumbline("calibrate", "propose", "--config", config)
    assert offered.returncode == 0, offered.stderr
    again = plumbline("calibrate", "propose", "--config", config)
    assert again.returncode == 1
    assert "was offered already" in again.stderr

    offer = peer.wait_for("health", lambda health: health["offer"])["offer"]
    assert f"offered: record {offer['record']}" in offered.stdout
    model = (made := store.record(offer["record"])).thermal
    assert model is not None
    assert made.parent == record.id
    slope = model["axes"]["z"]["offset_per_c"][0] * 1000
    assert abs(slope - mg_per_c) < 3 * 1000 * np.sqrt(model["axes"]["z"]["covariance"][0][0])
    assert store.state().in_force == record.id
    status = plumbline("remote", "status", "--connect", gateway.endpoint)
    assert f"remote rollback --to {offer['record']}" in status.stdout
    assert offer["record"] in plumbline("doctor", "--config", config).stdout

    put = ("rollback", "--to", offer["record"], "--by", "ann", "--reason", "offered", "--connect", gateway.endpoint)
    done = plumbline("remote", *put)
    assert done.returncode == 0, done.stderr
    in_force = peer.wait_for("health", lambda health: health["calibration_id"] == offer["record"])
    assert in_force["offer"] is None
    assert store.state().in_force == offer["record"]
