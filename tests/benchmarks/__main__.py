"""`script/bench`: run the named benchmarks, or all; options after a single name are for that benchmark."""

import sys
from collections.abc import Callable
from itertools import takewhile

from tests.benchmarks import (
    alert_latency,
    archive,
    bridge_cuts,
    bridge_memory,
    bridges,
    calibration,
    chain,
    conditions,
    daemon,
    delay,
    expected_peaks,
    fleet,
    footprint,
    gateway_states,
    incident,
    inclinometer,
    killed_session,
    laser,
    motion,
    motion_gyro,
    page,
    real_cranes,
    record_info,
    recorder,
    rotation,
    sensors,
    serial_decoders,
    swing,
)

ALL: dict[str, Callable[..., None]] = {
    "chain": chain.main,
    "daemon": daemon.main,
    "footprint": footprint.main,
    "delay": delay.main,
    "alert_latency": alert_latency.main,
    "gateway_states": gateway_states.main,
    "swing": swing.main,
    "motion": motion.main,
    "motion_gyro": motion_gyro.main,
    "real_cranes": real_cranes.main,
    "expected_peaks": expected_peaks.main,
    "conditions": conditions.main,
    "calibration": calibration.main,
    "inclinometer": inclinometer.main,
    "laser": laser.main,
    "rotation": rotation.main,
    "killed_session": killed_session.main,
    "record_info": record_info.main,
    "recorder": recorder.main,
    "incident": incident.main,
    "sensors": sensors.main,
    "serial_decoders": serial_decoders.main,
    "fleet": fleet.main,
    "page": page.main,
    "bridges": bridges.main,
    "bridge_cuts": bridge_cuts.main,
    "bridge_memory": bridge_memory.main,
    "archive": archive.main,
}

names = list(takewhile(lambda argument: not argument.startswith("-"), sys.argv[1:]))
options = sys.argv[1 + len(names) :]
unknown = [name for name in names if name not in ALL]
if unknown:
    sys.exit(f"no benchmark {', '.join(unknown)}; there are {', '.join(ALL)}")
with_options = [
    "archive",
    "bridge_cuts",
    "bridge_memory",
    "expected_peaks",
    "footprint",
    "motion",
    "motion_gyro",
    "real_cranes",
    "record_info",
]
if options and (len(names) != 1 or names[0] not in with_options):
    sys.exit(f"only the benchmarks {', '.join(with_options)} have options, one at a time")
for name in names or ALL:
    ALL[name](*([options] if options else []))
