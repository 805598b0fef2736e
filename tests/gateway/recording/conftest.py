"""Messages of every topic, and a recorder in a folder of its own."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import pytest

from devices.block import DeviceInfo
from gateway import messages
from gateway.pipeline.outgoing_message import encode_message
from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples

HEAD: dict[str, Any] = {"time_ns": START_NS, "clock": "synchronised", "sequence": 5, "calibration_id": "c-1"}
COUNTS_PER_G = 256_000.0
GATEWAY = "yard/crane-2/hook"

MOTION = messages.Motion(
    **HEAD,
    state="driven",
    angle_deg=3.1,
    u_deg=0.05,
    azimuth_deg=-120.0,
    rate_deg_s=2.5,
    pivot_accel_m_s2=[0.2, -0.1],
    pivot_accel_u_m_s2=0.02,
    hoist_m_s=0.0,
    hoist_u_m_s=0.01,
    length_m=12.0,
    length_u_m=0.05,
    phi_max_deg=4.0,
    phi_max_u_deg=0.05,
    predicted_phi_max_deg=4.5,
    predicted_u_deg=0.1,
    time_to_peak_s=1.2,
    coasting_phi_max_deg=4.2,
    coasting_u_deg=0.1,
    coasting_time_to_peak_s=1.1,
    lean_deg=0.3,
    lean_u_deg=None,
    probabilities=messages.MotionProbabilities(free=0.1, driven=0.9, wind=0.0, hoisting=0.01),
    fast_oscillation_hz=None,
    fast_oscillation_deg=None,
    reasons=["the pivot accelerates by 0.22 m/s^2 (u 0.02)"],
    text="Trolley moving. Swing 4.0° ± 0.1°.",
)
AlertEvent = Literal["raised", "changed", "cleared", "standing"]
MakeRecorder = Callable[..., Recorder]
Record = Callable[..., list[Path]]
SECOND_NS = 1_000_000_000


DEVICE = DeviceInfo(
    kind="adxl355",
    device_id="adxl355-0x1d-label7",
    unit="counts",
    odr_hz=1000.0,
    units_per_g=COUNTS_PER_G,
    full_scale_g=2.048,
    noise_g=5e-4,
    details={"revision": "1", "bus": "/dev/i2c-1"},
)
HEADER = RecordingHeader(
    software="0.1.0",
    site="yard",
    crane="crane-2",
    sensor="hook",
    boot_id="b00t",
    configuration_toml='[gateway]\nsite = "yard"  # größte Halle\n',
)


@pytest.fixture
def header() -> RecordingHeader:
    """Whose recordings are made; a module may state another."""
    return HEADER


@pytest.fixture
def make_recorder(tmp_path: Path, header: RecordingHeader) -> MakeRecorder:
    def make(
        data_dir: Path = tmp_path, segment_s: float = 600.0, fsync_s: float = 1.0, quota_mb: float = 100.0
    ) -> Recorder:
        return Recorder(data_dir, header, segment_s=segment_s, fsync_s=fsync_s, quota_mb=quota_mb)

    return make


def make_tilt(axial_deg: float | None) -> messages.Tilt:
    return messages.Tilt(
        **HEAD,
        pitch_deg=None,
        roll_deg=0.25,
        axial_deg=axial_deg,
        u_deg=0.02,
        direction_deg=-12.0,
        specific_force_g=[0.0, 0.1, 0.99],
        temperature_c=None,
        delay_s=0.225,
        trusted=True,
    )


def make_swing(phi_max_deg: float | None, time_ns: int = START_NS) -> messages.Swing:
    return messages.Swing(
        **{**HEAD, "time_ns": time_ns},
        swinging=phi_max_deg is not None,
        phi_max_deg=phi_max_deg,
        u_deg=0.05,
        coverage95_deg=[0.1, 0.2],
        minor_phi_max_deg=0.1,
        azimuth_deg=45.0,
        lean_deg=0.3,
        lean_azimuth_deg=None,
        period_s=6.9,
        predicted_phi_max_deg=None,
        predicted_u_deg=None,
        time_to_peak_s=None,
        formulas_deg=messages.Formulas(
            arccos_min_az=1.0, arcsin_max_axy=None, arctan_max_axy_min_az=1.1, arccos_max_az=1.2
        ),
        reasons=[],
    )


def make_alert(event: AlertEvent) -> messages.Alert:
    standing = messages.ActiveAlert(
        rule="swing",
        level="trip",
        since_ns=START_NS,
        value_deg=6.2,
        limit_deg=6.0,
        clear_deg=3.0,
        text="swing 6.2 deg",
    )
    return messages.Alert(
        **HEAD,
        level="normal" if event == "cleared" else "trip",
        event=event,
        rule="swing",
        active=[] if event == "cleared" else [standing],
        text=f"swing 6.2 deg ({event})",
    )


def make_calibration(name: str) -> messages.Calibration:
    return messages.Calibration(
        **{**HEAD, "calibration_id": name},
        status="calibrated",
        device_id="adxl355-0x1d-label7",
        record={"format": 1, "id": name, "offset": [0.1, 1e-17, -3.5], "thermal": None},
        in_force={"gain_g_per_unit": [[3.9e-6, 0, 0], [0, 3.9e-6, 0], [0, 0, 3.9e-6]], "bias_g": [0.0, 0.0, 0.0]},
        text="six-position, 2026-01-01",
    )


EVERY_MESSAGE: dict[str, messages.Message | messages.Log] = {
    "samples": make_samples(),
    "acceleration": messages.Acceleration(
        **HEAD,
        x_g=0.01,
        y_g=0.0,
        z_g=0.99,
        x_min_g=-0.02,
        x_max_g=0.04,
        y_min_g=-0.01,
        y_max_g=0.01,
        z_min_g=0.8,
        z_max_g=1.3,
    ),
    "tilt": make_tilt(1.5),
    "motion": MOTION,
    "swing": make_swing(None),
    "condition": messages.Condition(
        **HEAD,
        verdict="swinging",
        cause=None,
        trusted=False,
        reasons=["jerk"],
        gates={"norm": True, "stationary": False},
        norm_g=1.0002,
        permissible_norm_error_g=None,
        calibration="calibrated",
    ),
    "alert": make_alert("raised"),
    "health": messages.Health(
        **HEAD,
        state="running",
        device_id=None,
        device_kind="adxl355",
        boot_id="b00t",
        software="0.1.0",
        uptime_s=12.5,
        measured_rate_hz=999.87,
        samples=12345,
        lost=1,
        invalid=0,
        faults={"overrun": 1},
        dropped={},
        recording="x.mcap",
        recording_error=None,
        disk_free_mb=1e4,
        cpu_percent=0.3,
        resident_mb=44.0,
    ),
    "calibration": make_calibration("c-1"),
    "mark": messages.Mark(**HEAD, id="cli-12345678", by="ann", text="Größe"),
    "clock": messages.ClockOffset(**HEAD, log_time_ns=START_NS, wall_offset_ns=-1500, stepped=False),
    "log": messages.Log(
        timestamp=messages.FoxgloveTime(sec=START_NS // 10**9, nsec=5), level=2, message="Größe", name="plumbline"
    ),
}
"""One message of each topic, null wherever a number may be missing in at least one of them."""


@pytest.fixture
def record(tmp_path: Path, header: RecordingHeader) -> Record:
    """Record segments of half a minute; without compaction the last one stays as it was written."""

    def run(
        start_ns: int,
        folder: Path = tmp_path / "data",
        segments: int = 3,
        quota_mb: float = 100.0,
        compacted: bool = True,
        closed: bool = True,
        signed: bool = True,
        gateway: str = GATEWAY,
    ) -> list[Path]:
        key = load_or_create_key(folder / "signing-key.pem") if signed else None
        chain = SegmentChain(folder, gateway, key)
        site, crane, sensor = gateway.split("/")
        of_gateway = replace(header, site=site, crane=crane, sensor=sensor)
        recorder = Recorder(folder, of_gateway, segment_s=30, fsync_s=1.0, quota_mb=quota_mb, chain=chain)
        recorder.set_device(DEVICE, start_ns)
        recorder.start(start_ns)
        for number in range(segments * 30 - 1):
            now_ns = start_ns + number * SECOND_NS
            recorder.write(encode_message("samples", make_samples(number), now_ns))
            recorder.tick(now_ns)
            for path in recorder.take_uncompacted():
                compact(path, chain)
        if closed:
            recorder.close()
        for path in recorder.take_uncompacted() if compacted else ():
            compact(path, chain)
        return sorted(folder.glob("*.mcap"))

    return run
