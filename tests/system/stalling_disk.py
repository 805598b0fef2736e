"""`plumbline` on a disk that stalls while a file exists: the calls of the system wait.

python -m tests.system.stalling_disk FILE run --config gateway.toml

Nothing is synced while FILE is empty. Where it contains a name, the files of this name cannot be opened instead; where it
contains "slow", every sync takes `SLOW_S`.
"""

import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

SLOW_S = 0.3
"""Seconds. Basis: a busy machine; a commit has five syncs and more."""


def main() -> int:
    gate, open_file = Path(sys.argv[1]), os.open

    def stalls(name: str) -> bool:
        with suppress(FileNotFoundError):
            return gate.read_text() == name
        return False

    def stalling_sync(call: Callable[[int], None]) -> Callable[[int], None]:
        def wait(descriptor: int) -> None:
            while stalls(""):
                time.sleep(0.05)
            if stalls("slow"):
                time.sleep(SLOW_S)
            call(descriptor)

        return wait

    def stalling_open(path: Any, *arguments: Any, **options: Any) -> int:
        while stalls(Path(os.fsdecode(path)).name):
            time.sleep(0.05)
        return open_file(path, *arguments, **options)

    os.fsync, os.fdatasync = stalling_sync(os.fsync), stalling_sync(os.fdatasync)  # type: ignore[assignment]
    os.open = stalling_open
    from gateway.cli.main import main as plumbline  # noqa: PLC0415  (after the calls were replaced)

    return plumbline(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
