"""What each page says exists before its commands are typed: recordings, a gateway, a site, an archive."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gateway.cli.main import main
from gateway.messages import Calibration
from gateway.pki.signing_key import read_public_key
from tests.documentation import bench_files
from tests.documentation.examples import ROOT
from tests.documentation.reader import Reader
from tests.gateway.archive.s3_server import running_s3
from tests.gateway.recorded_crane import record_crane
from tests.ports import unused_port
from tests.system.conftest import BusPeer
from tests.system.mosquitto import Mosquitto
from tests.system.opcua_site import issue
from tests.waiting import wait_until

World = Callable[[Reader], None]
SERVICE = "/var/lib/plumbline"
SETTINGS = "/etc/plumbline/plumbline.toml"
RIG = "[rope]\nlength_m = 8.0\n[housing]\nposition_m = 3.0\n[sensor]\nsample_rate_hz = 25\nnoise_g = 0.0003\n"


def nothing(reader: Reader) -> None:
    """Only what is installed."""


def gateway(reader: Reader) -> None:
    """A simulated crane that is watched since its first swing; its data are in `plumbline-data`."""
    _begin_and_watch(reader, "plumbline run")


def _begin_and_watch(reader: Reader, command: str, **environment: str) -> None:
    reader.begin(command, **environment)
    peer = BusPeer(reader.endpoint)
    peer.wait_for("swing")
    peer.close()


def service(reader: Reader) -> None:
    """The same gateway as the service of a machine, with its settings in `/etc`."""
    for name in ("gateway.toml", "gateway.toml.until-1"):
        (reader.folder / name).write_text("[alerts]\ntrip_deg = 6.0\n")
    _begin_and_watch(reader, "plumbline run --config gateway.toml")
    reader.texts |= {
        "config check --service": "config check",
        SETTINGS: str(reader.folder / "gateway.toml"),
        SERVICE: str(reader.folder / "plumbline-data"),
        "plumbline doctor": "plumbline doctor --config gateway.toml",
    }
    reader.taken_from_output["apply ID"] = r"config (apply \S+)"


def bench_and_gateway(reader: Reader) -> None:
    """Turns of the bench, and a gateway."""
    bench_files.turns(reader)
    gateway(reader)


def site(reader: Reader) -> None:
    """A gateway that gets the certificate which the page issues."""
    keys = reader.folder / "plumbline-keys"
    reader.texts |= {"tls/10.0.0.5:7447": f"tls/127.0.0.1:{unused_port()}", "10.0.0.5": "127.0.0.1"}
    reader.texts |= {"service-ann": str(keys / "service-ann")}

    def begin() -> None:
        files = {"ca": "ca", "certificate": "certificate", "key": "key"}
        tls = {
            f"PLUMBLINE_BUS__TLS__{each.upper()}": str(keys / "gateway-crane-1" / f"{file}.pem")
            for each, file in files.items()
        }
        endpoint = reader.texts["tls/10.0.0.5:7447"]
        reader.begin("plumbline run", PLUMBLINE_BUS__LISTEN=json.dumps([endpoint]), **tls)
        wait_until(lambda: list((reader.folder / "plumbline-data").glob("*.mcap")), "the gateway")

    reader.before["tls/10.0.0.5:7447"] = begin


def recordings(reader: Reader) -> None:
    """A gateway's recordings of half a minute with one incident, and the public key kept apart."""
    data = reader.folder / "plumbline-data"
    reader.have("recordings", lambda folder: record_crane(folder / data.name, 30.0))
    bench_files.copied(data / "signing-key.pem.pub", reader.folder / "KEPT.pub")
    shutil.copy(min(data.glob("*.mcap")), reader.folder / "recording.mcap")
    (reader.folder / "signing-key.pem.pub").write_bytes((data / "signing-key.pem.pub").read_bytes())
    reader.exit_codes |= {"plumbline record incident plumbline-data --last": 3}  # without the key
    reader.texts |= {
        "--alert 3": "--alert 1",
        "--from 07:28:00 --to 07:35:00": "--from 2026-01-01T00:00:00Z --to 2026-01-01T00:00:20Z",
        SERVICE: str(data),
    }


def other_recordings(reader: Reader) -> None:
    """Simulated logs of a rig, one of a phone that hangs with its y axis up, and one of a crane at work."""
    reader.have("other-recordings", _simulate_recordings)


def _simulate_recordings(folder: Path) -> None:
    rig = folder / "rig.toml"
    rig.write_text(RIG)
    for name, seed in (("log.csv", 1), ("second.csv", 2), ("work.csv", 3), ("work.mcap", 3)):
        arguments = ["simulate", str(rig), "--out", str(folder / name), "--effect", "viscous_damping"]
        assert main([*arguments, "--seed", str(seed), "--duration", "40"]) == 0
    table = np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1)
    phone = np.column_stack([1e3 * table[:, 0], 9.80665 * table[:, [1, 3]], -9.80665 * table[:, 2]])
    head = "stamp,accX,accY,accZ"
    np.savetxt(folder / "phone.csv", phone, delimiter=",", header=head, comments="", fmt="%.5f")


def findings(reader: Reader) -> None:
    """Recordings of a gateway and of others."""
    recordings(reader)
    other_recordings(reader)


def recordings_and_gateway(reader: Reader) -> None:
    """Recordings that were copied from a gateway which still runs."""
    recordings(reader)
    reader.begin("plumbline run", PLUMBLINE_GATEWAY__DATA_DIR=str(reader.folder / "of-the-gateway"))


def archive(reader: Reader) -> None:
    """Recordings of a crane, another record of its sensor, and an object store."""
    source = reader.folder / "recordings"
    crane = record_crane(source / "crane-2", 20.0)
    key = read_public_key(str(crane.folder / "signing-key.pem.pub"))
    (reader.folder / "keys.txt").write_text(f"yard/crane-2/hook  {key}\n")
    record = next(each.message.record for each in crane.messages if isinstance(each.message, Calibration))
    (reader.folder / "record.json").write_text(json.dumps(record))
    server = reader.stack.enter_context(running_s3())
    (reader.folder / "s3.toml").write_text("".join(f"{k} = {json.dumps(v)}\n" for k, v in server.settings.items()))
    (reader.folder / "s3.toml").chmod(0o600)
    reader.environment |= {"AWS_ALLOW_HTTP": "true"}
    reader.texts |= {
        "/srv/recordings": str(source),
        "/srv/archive": str(reader.folder / "archive"),
        SERVICE: str(crane.folder),
        "2026-10-01 --to 2026-11-01": "2026-01-01 --to 2026-02-01",
    }


def fleet(reader: Reader) -> None:
    """A router, a gateway, and another one that is expected; certificates for a router with TLS."""
    reader.exit_codes = {"plumbline fleet status --connect": 1, "plumbline fleet status --expect": 2}
    reader.begin(f"plumbline fleet router --listen {reader.endpoint}")
    client = {"PLUMBLINE_BUS__MODE": "client", "PLUMBLINE_BUS__CONNECT": json.dumps([reader.endpoint])}
    _begin_and_watch(reader, "plumbline run", PLUMBLINE_BUS__LISTEN="[]", **client)
    (reader.folder / "gateways.txt").write_text("yard/crane-1/hook\nyard/crane-7/hook  crane-7-new\n")
    reader.texts |= {
        "tcp/10.0.0.2:7447": reader.endpoint,
        "/etc/plumbline/gateways.txt": "gateways.txt",
        "127.0.0.1:8322": f"127.0.0.1:{unused_port()}",
        "tls/10.0.0.2:7447": f"tls/127.0.0.1:{unused_port()}",
    }
    for line in ("keys init --site yard", "keys issue router router-1 --host 127.0.0.1"):
        assert main([*line.split(), "--folder", str(reader.folder / "plumbline-keys")]) == 0
    for path in (reader.folder / "plumbline-keys" / "router-router-1").glob("*.pem"):
        shutil.copy(path, reader.folder)


def plant(reader: Reader) -> None:
    """The gateway, a broker, and settings of the bridges with a certificate for OPC UA."""
    gateway(reader)
    broker = Mosquitto(reader.folder)
    reader.stack.callback(broker.stop)
    certificate, key = issue(reader.folder / "opcua", "server")
    issue(reader.folder / "opcua" / "trusted", "client")[1].unlink()
    (reader.folder / "bridge.toml").write_text(
        f"demonstration = true\n[modbus]\nlisten = '127.0.0.1:{unused_port()}'\n"
        f"[mqtt]\nhost = '127.0.0.1'\nport = {broker.port}\n"
        f"[opcua]\nlisten = '127.0.0.1:{unused_port()}'\ncertificate = '{certificate}'\nkey = '{key}'\n"
        f"trusted = '{reader.folder / 'opcua' / 'trusted'}'\n[foxglove]\nlisten = '127.0.0.1:{unused_port()}'\n"
    )


WORLDS: dict[str, World] = {
    "README.md#Try it": gateway,
    "README.md#Install it": gateway,
    "README.md#Find out what happened": findings,
    "docs/guides/integrator/README.md": nothing,
    "docs/guides/integrator/archive.md": archive,
    "docs/guides/integrator/fleet.md": fleet,
    "docs/guides/integrator/plant.md": plant,
    "docs/guides/investigator/README.md": recordings,
    "docs/guides/investigator/angle.md": recordings,
    "docs/guides/investigator/read_other_recordings.md": other_recordings,
    "docs/guides/investigator/reconcile.md": other_recordings,
    "docs/guides/investigator/recordings.md": recordings_and_gateway,
    "docs/guides/investigator/twin.md": nothing,
    "docs/guides/investigator/viewers/README.md": recordings,
    "docs/guides/service/README.md": service,
    "docs/guides/service/alignment.md": bench_and_gateway,
    "docs/guides/service/calibration.md": bench_files.calibration_sessions,
    "docs/guides/service/certificate.md": bench_files.calibrated_before,
    "docs/guides/service/deflection.md": bench_files.girder,
    "docs/guides/service/drift.md": bench_files.calibrated_before,
    "docs/guides/service/installed.md": bench_files.weeks,
    "docs/guides/service/laser.md": bench_files.laser,
    "docs/guides/service/recovery.md": service,
    "docs/guides/service/rotation.md": bench_files.turns,
    "docs/guides/service/security.md": site,
    "docs/guides/service/single_parameter.md": bench_files.laser,
    "docs/guides/service/thermal.md": bench_files.ramps,
}


def world_of(page: Path, section: str) -> World:
    """Return what exists where a section's commands are typed."""
    name = page.relative_to(ROOT).as_posix()
    return WORLDS.get(f"{name}#{section}") or WORLDS.get(name) or nothing
