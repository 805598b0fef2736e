"""A small fleet, recorded once."""

from pathlib import Path

import pytest

from tests.gateway.archive.small_recordings import SmallCrane, indexed, keys_file


@pytest.fixture(scope="package")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> list[SmallCrane]:
    """Three cranes of three segments each, in folders below one."""
    folder = tmp_path_factory.mktemp("fleet")
    peaks_deg = {"crane-1": 6.0, "crane-2": 3.0, "crane-3": 8.0}
    return [SmallCrane(folder / name, name, peak_deg=peak_deg).record() for name, peak_deg in peaks_deg.items()]


@pytest.fixture(scope="package")
def keys(fleet: list[SmallCrane], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return keys_file(tmp_path_factory.mktemp("keys") / "keys.txt", *fleet)


@pytest.fixture(scope="package")
def clean(fleet: list[SmallCrane], keys: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of a single undisturbed run over the fleet."""
    table = tmp_path_factory.mktemp("clean") / "table"
    indexed(fleet[0].folder.parent, table, keys)
    return table
