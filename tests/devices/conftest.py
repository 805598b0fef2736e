"""Parts that stand in for hardware, for the tests of this folder."""

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.devices.adxl355_rig import Rig

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def chips() -> ModuleType:
    """The module `adxl355_chip`: with import mode importlib its folder is not on the path."""
    spec = importlib.util.spec_from_file_location("adxl355_chip", HERE / "adxl355_chip.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def rig(chips: ModuleType) -> Callable[..., Rig]:
    """Makes an ADXL355 at the bus with its driver."""

    def make(**arguments: Any) -> Rig:
        return Rig(chips, **arguments)

    return make
