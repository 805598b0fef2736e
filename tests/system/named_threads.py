"""`plumbline` that writes the name of each thread that it starts, and the bound of its queue, into a file.

python -m tests.system.named_threads FILE run --config gateway.toml
"""

import sys
import threading
from pathlib import Path

from gateway.cli.main import main as plumbline


def main() -> int:
    start, path = threading.Thread.start, Path(sys.argv[1])

    def note(self: threading.Thread) -> None:
        inbox = getattr(self, "inbox", None)
        with path.open("a") as file:
            file.write(f"{self.name}\t{'-' if inbox is None else inbox.size}\n")
        start(self)

    threading.Thread.start = note  # type: ignore[method-assign]
    return plumbline(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
