"""`plumbline` whose configuration on trial must be healthy within 20 s of the start, instead of a minute.

python -m tests.system.short_trial run --config gateway.toml
"""

import sys

from gateway.cli.main import main
from gateway.daemon.commands import configuration_service

if __name__ == "__main__":
    vars(configuration_service).update(DEADLINE_S=2 * configuration_service.HEALTHY_S)
    sys.exit(main(sys.argv[1:]))
