"""A reader at a terminal who types what a page prints, in a folder of their own."""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from tests.documentation.examples import ROOT, Command, is_as_shown
from tests.ports import unused_port
from tests.waiting import PATIENCE_S, wait_until

ENDLESS = (
    "plumbline run",
    "plumbline remote watch",
    "plumbline remote align",
    "plumbline bridge ",
    "plumbline fleet page",
    "plumbline fleet router",
    "plumbline record play",
    "plumbline archive upload",
)
"""Commands that go on until Ctrl-C; they are stopped when the page has been read to its end."""
EDIT = "sed -i 's/trip_deg = 6.0/trip_deg = 5.5/'"
"""What the reader does in an editor."""
STOPPED = (0, 130)
"""Exit codes after Ctrl-C."""


@dataclass
class Reader:
    """The folder with what the page says exists, and what stands for names that are of a site elsewhere."""

    folder: Path
    shared: Path
    """Where files are kept that several pages have, so that they are made once."""
    texts: dict[str, str] = field(default_factory=dict)
    """What the reader types in place of a text of the page: addresses, folders of a service, times, identities."""
    taken_from_output: dict[str, str] = field(default_factory=dict)
    """The same of what a command before has printed, by a pattern with one group."""
    exit_codes: dict[str, int] = field(default_factory=dict)
    """Exit codes by the beginning of a command, where the answer with what exists here is no."""
    before: dict[str, Callable[[], None]] = field(default_factory=dict)
    """What is done by then, by a text of the first command that needs it."""
    environment: dict[str, str] = field(default_factory=dict)
    stack: ExitStack = field(default_factory=ExitStack)
    """Ends what the page began."""
    printed: str = ""

    def __post_init__(self) -> None:
        """Put `plumbline` on the path; commands mean the gateway of this folder."""
        programs = self.folder / ".venv" / "bin"
        programs.mkdir(parents=True)
        for name, does in {"plumbline": f"exec {shlex.quote(sys.executable)} -m gateway", "nano": EDIT}.items():
            program = programs / name
            program.write_text(f'#!/bin/sh\n{does} "$@"\n')
            program.chmod(0o755)
        endpoint = f"tcp/127.0.0.1:{unused_port()}"
        self.environment |= {
            "PATH": f"{programs}:{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "PYTHONUNBUFFERED": "1",
            "XDG_STATE_HOME": str(self.folder / "state"),
            "PLUMBLINE_GATEWAY__SITE": "yard",
            "PLUMBLINE_GATEWAY__CRANE": "crane-1",
            "PLUMBLINE_GATEWAY__SENSOR": "hook",
            "PLUMBLINE_BUS__LISTEN": json.dumps([endpoint]),
            "PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{unused_port()}",
            "PLUMBLINE_CONNECT": endpoint,
        }

    def have(self, name: str, make: Callable[[Path], object]) -> None:
        """Have files that `make` makes in a folder; they are the same on every page."""
        kept = self.shared / name
        if not kept.exists():
            kept.mkdir(parents=True)
            make(kept)
        shutil.copytree(kept, self.folder, dirs_exist_ok=True)

    @property
    def endpoint(self) -> str:
        """The address of the gateway of this folder."""
        return self.environment["PLUMBLINE_CONNECT"]

    def type(self, command: Command) -> None:
        """Run a command; it ends well, and prints what the page shows."""
        for shown in [shown for shown in self.before if shown in command.text]:
            self.before.pop(shown)()
        text = self._in_this_folder(command.text)
        if text.startswith(ENDLESS):
            self.begin(text)
            return
        done = subprocess.run(
            ["sh", "-c", text],
            cwd=self.folder,
            env=self._all_environment(),
            capture_output=True,
            text=True,
            timeout=4 * PATIENCE_S,
            check=False,
        )
        self.printed = done.stdout
        where = f"{command.place}: {text}\n{done.stdout}{done.stderr}"
        expected = next((code for start, code in self.exit_codes.items() if text.startswith(start)), 0)
        assert done.returncode == expected, where
        assert "Traceback" not in done.stderr, where
        if command.shown is not None:
            assert is_as_shown(command.shown, done.stdout), where

    def _in_this_folder(self, text: str) -> str:
        found = {name: re.search(pattern, self.printed) for name, pattern in self.taken_from_output.items()}
        typed = self.texts | {name: match[1] for name, match in found.items() if match}
        for shown, there in typed.items():
            text = text.replace(shown, there)
        return text.removeprefix(".venv/bin/")

    def begin(self, text: str, **environment: str) -> "subprocess.Popen[bytes]":
        """Start what goes on until Ctrl-C: it says something, and ends well at the end of the page."""
        log = self.folder / f"output-{len(list(self.folder.glob('output-*')))}.txt"
        with log.open("w") as output:
            process = subprocess.Popen(
                ["sh", "-c", f"exec {text}"],
                cwd=self.folder,
                env={**self._all_environment(), **environment},
                stdout=output,
                stderr=subprocess.STDOUT,
            )
        self.stack.callback(self._stop, process, f"{text}\n", log)
        wait_until(lambda: log.read_text() or process.poll() is not None, text)
        return process

    def _stop(self, process: "subprocess.Popen[bytes]", text: str, log: Path) -> None:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            code = process.wait(PATIENCE_S)
        finally:
            process.kill()
            process.wait()
        assert code in STOPPED, text + log.read_text()
        assert "Traceback" not in log.read_text(), text + log.read_text()

    def _all_environment(self) -> Mapping[str, str]:
        return {**os.environ, **self.environment}
