"""An S3-compatible server on loopback, a process of its own."""

import os
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from tests.ports import unused_port
from tests.waiting import wait_until


@dataclass(frozen=True)
class S3Server:
    """A running server with a bucket."""

    endpoint: str
    bucket: str = "cranes"

    @property
    def settings(self) -> dict[str, str]:
        """The settings of a store."""
        return {
            "aws_endpoint_url": self.endpoint,
            "aws_access_key_id": "crane",
            "aws_secret_access_key": "secret",
            "aws_region": "eu-central-1",
        }

    @property
    def environment(self) -> dict[str, str]:
        """The same for a process."""
        return {
            **os.environ,
            **{name.upper(): value for name, value in self.settings.items()},
            "AWS_ALLOW_HTTP": "true",
        }


@contextmanager
def running_s3(port: int | None = None) -> Iterator[S3Server]:
    """Run a server, empty but for its bucket."""
    port = port or unused_port()
    server = S3Server(f"http://127.0.0.1:{port}")
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: process.poll() is not None or _makes_bucket(server), "the S3 server")
        yield server
    finally:
        process.kill()
        process.wait()


def _makes_bucket(server: S3Server) -> bool:
    request = urllib.request.Request(f"{server.endpoint}/{server.bucket}", method="PUT")
    try:
        with urllib.request.urlopen(request, timeout=5):
            return True
    except OSError:
        return False
