"""`plumbline` on a disk that takes nothing while a file exists: the calls that sync wait at the place of the system's.

python -m tests.system.stalling_disk FILE run --config gateway.toml
"""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path


def main() -> int:
    gate = Path(sys.argv[1])

    def stalling(call: Callable[[int], None]) -> Callable[[int], None]:
        def wait(descriptor: int) -> None:
            while gate.exists():
                time.sleep(0.05)
            call(descriptor)

        return wait

    os.fsync, os.fdatasync = stalling(os.fsync), stalling(os.fdatasync)  # type: ignore[assignment]
    from gateway.cli.main import main as plumbline  # noqa: PLC0415  (after the calls were replaced)

    return plumbline(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
