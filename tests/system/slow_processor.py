"""`plumbline` with a processor that takes its time for each block, and from a block on for ever; it is waited for three seconds.

python -m tests.system.slow_processor SECONDS HANGS_AT run --replay log.csv --speed 0
"""

import sys
import time

from gateway.cli.main import main as plumbline
from gateway.daemon import gateway
from gateway.daemon.processor import Processor
from gateway.daemon.sampling.sampler import SamplerItem

HANG_S = 60.0


def main() -> int:
    step_s, hangs_at = float(sys.argv[1]), int(sys.argv[2])
    handle, handled = Processor.handle, 0

    def take_time(self: Processor, item: SamplerItem) -> None:
        nonlocal handled
        handled += 1
        time.sleep(HANG_S if handled == hangs_at else step_s)
        handle(self, item)

    Processor.handle = take_time  # type: ignore[method-assign]
    vars(gateway).update(DRAIN_S=3.0, HUNG_S=3.0)
    return plumbline(sys.argv[3:])


if __name__ == "__main__":
    sys.exit(main())
