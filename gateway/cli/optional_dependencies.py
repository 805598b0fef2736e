"""Optional parts of Plumbline, installed as extras."""

import importlib.util

from gateway.errors import InputError

OF_THE_TWIN = ("casadi", "matplotlib", "scipy")


def require_twin() -> None:
    """Raise `InputError` where the twin's libraries are missing."""
    _require(OF_THE_TWIN)


def require_plots() -> None:
    """Raise `InputError` where the library of the figures is missing."""
    _require(("matplotlib",))


def _require(names: tuple[str, ...]) -> None:
    missing = [name for name in names if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"{' and '.join(missing)} not installed; try pip install 'plumbline-gateway[twin]'")
