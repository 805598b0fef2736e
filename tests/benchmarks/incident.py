"""Time and memory of `plumbline record incident` for an hour at 100 Hz, in segments of 10 minutes."""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from gateway.errors import WITH_LOSSES
from tests.benchmarks.record_info import RATE_HZ, write_recordings

HOUR_S = 3600


def main() -> None:
    """Print the time and the memory of the report, and the size of its folder."""
    with tempfile.TemporaryDirectory() as name:
        recordings, report = Path(name) / "recordings", Path(name) / "report"
        write_recordings(recordings, HOUR_S)
        begin_s, begin_cpu_s = time.monotonic(), _children_cpu_s()
        interval = ("--from", "0", "--to", str(HOUR_S))
        command = [
            sys.executable,
            "-m",
            "gateway",
            "record",
            "incident",
            str(recordings),
            *interval,
            "--out",
            str(report),
        ]
        done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
        if done.returncode != WITH_LOSSES:  # nothing is signed
            raise SystemExit(done.returncode)
        used_s, cpu_s = time.monotonic() - begin_s, _children_cpu_s() - begin_cpu_s
        resident_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        sizes = ", ".join(
            f"{path.name} {path.stat().st_size / 1e6:.1f} MB" for path in sorted(report.glob("incident.*"))
        )
        print(f"record incident: {HOUR_S} s at {RATE_HZ} Hz")
        print(f"  {used_s:.1f} s, {cpu_s:.1f} s of CPU, at most {resident_mb:.0f} MiB; {sizes}")


def _children_cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
