"""What the tests of the twin share."""

from collections.abc import Iterator

import pytest

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.registry import BUILT_IN


@pytest.fixture
def vocabulary() -> Iterator[None]:
    """Remove the effects that a test adds."""
    yield
    for source in EFFECTS.sources - {BUILT_IN}:
        EFFECTS.unregister(source)
