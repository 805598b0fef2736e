"""`script/bench`: run the named benchmarks, or all."""

import sys

from tests.benchmarks import calibration, chain, conditions, daemon, delay, killed_session, swing

ALL = {
    "chain": chain.main,
    "daemon": daemon.main,
    "delay": delay.main,
    "swing": swing.main,
    "conditions": conditions.main,
    "calibration": calibration.main,
    "killed_session": killed_session.main,
}

wanted = sys.argv[1:] or list(ALL)
unknown = [name for name in wanted if name not in ALL]
if unknown:
    sys.exit(f"no benchmark {', '.join(unknown)}; there are {', '.join(ALL)}")
for name in wanted:
    ALL[name]()
