"""The files of mutual TLS, checked before a gateway uses them."""

import importlib.util
from collections.abc import Iterator, Mapping
from pathlib import Path

LIBRARY = "cryptography"
EXPIRES_SOON_DAYS = 30
"""A certificate with fewer days left is reported. Basis: a choice; time for the next visit at a crane, and no warning for
years."""


def find_problems(files: Mapping[str, Path]) -> Iterator[str]:
    """Yield what is wrong with the files of `bus.tls`, by the names of their keys, one line each."""
    unreadable = False
    for name, path in files.items():
        try:
            path.read_bytes()
        except OSError as error:
            unreadable = True
            yield f"bus.tls.{name}: {path}: cannot be read ({error.strerror}); plumbline keys issue makes it"
    if files and not unreadable and importlib.util.find_spec(LIBRARY) is not None:
        from gateway.pki.check_certificates import find_content_problems  # noqa: PLC0415 (its library is an extra)

        yield from find_content_problems(files)
