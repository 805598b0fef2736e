"""Parts of Plumbline that are installed only where they are wanted."""

import importlib.util

from gateway.errors import InputError

OF_THE_TWIN = ("casadi", "matplotlib", "scipy")


def require_twin() -> None:
    """Raise `InputError` where the twin's libraries are missing."""
    missing = [name for name in OF_THE_TWIN if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"{' and '.join(missing)} not installed; mend: pip install 'plumbline-gateway[twin]'")
