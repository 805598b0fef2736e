"""A proposed change of the configuration over the bus: its validation, and the text of the file that follows from it."""

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gateway.configuration.difference import KeyChange, difference
from gateway.configuration.loading import ConfigurationError, load_text
from gateway.configuration.remote_keys import REMOTE_KEYS, is_network_key, require_bounds, require_remote

Table = dict[str, Any]


@dataclass(frozen=True, slots=True)
class CheckedProposal:
    """A proposal that the gateway accepts."""

    text: str
    """The whole new file."""
    changes: list[KeyChange]


def text_hash(text: str) -> str:
    """Return the SHA-256 of a file's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def check_proposal(
    text: str, proposal: Table, *, allow_network: bool, environment: Mapping[str, str] = os.environ
) -> CheckedProposal:
    """Return the file and the changes that follow from a proposal.

    A section of the proposal replaces the keys of that section which may be changed over the bus; other sections stay, and so do
    the comments of the file. Raises `ConfigurationError` where the result is not valid, the same, or not permitted.
    """
    require_remote(proposal)
    where = "proposal"
    new_text = _merge(text, proposal)
    load_text(new_text, where, environment)
    # Compared without the environment, which would hide a change of a key that it overrides.
    changes = difference(load_text(text, "the present configuration", {}), load_text(new_text, where, {}))
    if not changes:
        raise ConfigurationError(f"{where}: changes nothing")
    require_bounds(changes)
    network = [change.key for change in changes if is_network_key(change.key)]
    if network and not allow_network:
        raise ConfigurationError(
            f"{where}: {', '.join(network)}: a wrong value cuts the gateway off; allow it with --allow-network"
        )
    return CheckedProposal(new_text, changes)


def _merge(text: str, proposal: Table) -> str:
    """Return the text of the file with the sections of a proposal."""
    import tomlkit  # noqa: PLC0415 loaded with the first proposal: the daemon starts without it

    document = tomlkit.parse(text)
    for name, keys in proposal.items():
        if name not in document:
            document[name] = tomlkit.table()
        section: Any = document[name]
        listed = REMOTE_KEYS[name]
        for key in [key for key in section if (listed is None or key in listed) and key not in keys]:
            del section[key]
        for key, value in keys.items():
            if key not in section or section[key] != value:
                section[key] = value
    return tomlkit.dumps(document)
