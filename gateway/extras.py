"""The extras of the distribution: which modules each brings, and which of them are missing."""

import importlib.util
from collections.abc import Sequence
from typing import Literal

from gateway.errors import InputError

Extra = Literal[
    "archive", "cluster", "foxglove", "laser", "mqtt", "opcua", "page", "parquet", "relay", "security", "twin"
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
    "twin": ("casadi", "matplotlib", "scipy"),
}
"""The modules that each extra brings."""


def missing_libraries(extra: Extra, libraries: Sequence[str] = ()) -> list[str]:
    """Return the libraries of an extra that are not installed; of those that are named, if any are."""
    return [name for name in libraries or LIBRARIES[extra] if importlib.util.find_spec(name) is None]


def require_extra(extra: Extra, libraries: Sequence[str] = ()) -> None:
    """Raise `InputError` where libraries of an extra are missing; of those that are named, if any are."""
    if missing := missing_libraries(extra, libraries):
        raise InputError(f"{' and '.join(missing)} not installed; try pip install 'plumbline-gateway[{extra}]'")


def require_plots() -> None:
    """Raise `InputError` where the library of the figures is missing."""
    require_extra("twin", ["matplotlib"])
