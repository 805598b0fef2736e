"""Programs forked from a process that has loaded the gateway: to load it takes most of the CPU time of a short run.

The printed commands of the documentation start the program as its users do.
"""

import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from multiprocessing.reduction import DupFd
from pathlib import Path
from typing import Any, TextIO

LOADED = ["gateway.cli.machine.run", "gateway.daemon.gateway", "gateway.certificate.digital_certificate", __name__]
SERVER = multiprocessing.get_context("forkserver")
SERVER.set_forkserver_preload(LOADED)


class Inherited:
    """A file descriptor that goes along with a fork."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __getstate__(self) -> Any:
        return DupFd(self.number)

    def __setstate__(self, state: Any) -> None:
        self.number = state.detach()


class ForkedProgram:
    """`python -m PROGRAM ...`, with the interface of `subprocess.Popen` as far as tests use it."""

    def __init__(self, words: Sequence[str], cwd: Path, env: Mapping[str, str], stdout: int, stderr: int) -> None:
        self.stdout, out = _stream(stdout)
        self.stderr, err = _stream(stderr)
        arguments = list(words), str(cwd), dict(env), Inherited(out), Inherited(err)
        self._process = SERVER.Process(target=_run, args=arguments, daemon=True)
        self._process.start()
        for stream, written in ((self.stdout, out), (self.stderr, err)):
            if stream is not None:
                os.close(written)

    @property
    def pid(self) -> int:
        assert self._process.pid is not None
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    def poll(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired(self._process.name, timeout or 0.0)
        return self._process.exitcode

    def send_signal(self, name: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, name)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """(standard output, standard error), where they are read here, once the program has ended."""
        said = ["", ""]

        def read(place: int, stream: TextIO) -> None:
            with stream:
                said[place] = stream.read()

        streams = [(place, each) for place, each in enumerate((self.stdout, self.stderr)) if each and not each.closed]
        readers = [threading.Thread(target=read, args=each, daemon=True) for each in streams]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join(timeout)
        return said[0], said[1]


def _stream(wanted: int) -> tuple[TextIO | None, int]:
    """Return what is read here, and what the program writes to."""
    if wanted != subprocess.PIPE:
        return None, wanted
    read, written = os.pipe()
    return os.fdopen(read), written


def _run(words: list[str], cwd: str, env: dict[str, str], out: Inherited, err: Inherited) -> None:
    for number, stream in ((1, out), (2, err)):
        os.dup2(stream.number, number)
        os.close(stream.number)
    sys.stdout = os.fdopen(1, "w", buffering=1)
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(env)
    program, *arguments = words
    sys.argv, sys.orig_argv = [program, *arguments], [sys.executable, "-m", program, *arguments]
    runpy.run_module(program, run_name="__main__")
