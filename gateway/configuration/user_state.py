"""Where a user's programs keep what they remember, by the XDG base directory specification."""

from collections.abc import Mapping
from pathlib import Path


def user_state_folder(name: str, environment: Mapping[str, str]) -> Path | None:
    """Return the folder of this name, which need not exist; None without a home."""
    state, home = environment.get("XDG_STATE_HOME"), environment.get("HOME")
    if state:
        return Path(state) / "plumbline" / name
    return Path(home) / ".local" / "state" / "plumbline" / name if home else None
