"""Parts that stand in for hardware, for the tests of this folder."""

from collections.abc import Callable

import pytest

from tests.devices.adxl355_rig import Rig


@pytest.fixture
def rig() -> Callable[..., Rig]:
    """Makes an ADXL355 at the bus with its driver."""
    return Rig
