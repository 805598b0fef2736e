"""Optional parts of Plumbline, installed as extras."""

import importlib.util

from gateway.errors import InputError

OF_THE_TWIN = ("casadi", "matplotlib", "scipy")


def require_twin() -> None:
    """Raise `InputError` where the twin's libraries are missing."""
    _require(OF_THE_TWIN, "twin")


def require_plots() -> None:
    """Raise `InputError` where the library of the figures is missing."""
    _require(("matplotlib",), "twin")


def require_parquet() -> None:
    """Raise `InputError` where the library for Parquet files is missing."""
    _require(("pyarrow",), "parquet")


def require_laser() -> None:
    """Raise `InputError` where the libraries for photographs and the printable board are missing."""
    _require(("cv2", "fpdf"), "laser")


def require_http() -> None:
    """Raise `InputError` where the HTTP server's libraries are missing."""
    _require(("starlette", "uvicorn"), "page")


def require_certificates() -> None:
    """Raise `InputError` where the library for certificates is missing."""
    _require(("cryptography",), "security")


def _require(libraries: tuple[str, ...], extra: str) -> None:
    missing = [name for name in libraries if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"{' and '.join(missing)} not installed; try pip install 'plumbline-gateway[{extra}]'")
