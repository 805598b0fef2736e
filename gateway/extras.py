"""The extras of the distribution: which modules each brings, and which of them are missing."""

import importlib.util
import sys
from collections.abc import Sequence
from typing import Literal

from gateway.errors import InputError

Extra = Literal[
    "archive",
    "cluster",
    "foxglove",
    "laser",
    "mqtt",
    "opcua",
    "page",
    "parquet",
    "relay",
    "security",
    "signing",
    "timestamp",
    "twin",
]
LIBRARIES: dict[Extra, tuple[str, ...]] = {
    "archive": ("cryptography", "deltalake", "duckdb", "obstore", "pyarrow"),
    "cluster": ("distributed",),
    "foxglove": ("foxglove",),
    "laser": ("cv2", "fpdf"),
    "mqtt": ("paho",),
    "opcua": ("asyncua",),
    "page": ("starlette", "uvicorn"),
    "parquet": ("pyarrow",),
    "relay": ("gpiod",),
    "security": ("cryptography",),
    "signing": ("cryptography",),
    "timestamp": ("cryptography", "rfc3161_client"),
    "twin": ("casadi", "matplotlib", "scipy"),
}
"""The modules that each extra brings."""


def what_is_missing(extra: Extra, libraries: Sequence[str] = ()) -> str | None:
    """Return in words which libraries of an extra are missing, and the remedy; None where none is.

    `libraries`: those of the extra that are needed; all, where none is named.
    """
    missing = [name for name in libraries or LIBRARIES[extra] if importlib.util.find_spec(name) is None]
    remedy = f"install the extra {extra}, in a clone by {sys.executable} -m pip install '.[{extra}]'"
    return f"{' and '.join(missing)} not installed; {remedy}" if missing else None


def require_extra(extra: Extra, libraries: Sequence[str] = ()) -> None:
    """Raise `InputError` where libraries of an extra are missing; of those that are named, if any are."""
    if (missing := what_is_missing(extra, libraries)) is not None:
        raise InputError(missing)


def require_plots() -> None:
    """Raise `InputError` where the library of the figures is missing."""
    require_extra("twin", ["matplotlib"])
