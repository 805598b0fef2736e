"""The installed configuration and the environment of the service."""

from pathlib import Path

import pytest

from gateway.configuration import loading


@pytest.fixture
def etc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(loading, "SETTINGS", tmp_path / "plumbline.toml")
    monkeypatch.setattr(loading, "SERVICE_ENVIRONMENT", tmp_path / "service.env")
    return tmp_path


def test_a_machine_without_an_installation_is_noticed(etc: Path) -> None:
    assert not loading.is_installed()


def test_the_environment_of_the_service_overrides_the_file(etc: Path) -> None:
    (etc / "plumbline.toml").write_text('[gateway]\ndata_dir = "elsewhere"\ncrane = "crane-7"\n')
    (etc / "service.env").write_text("# a comment\n\nPLUMBLINE_GATEWAY__DATA_DIR=/var/lib/plumbline\n")
    configuration = loading.load_installed({})
    assert loading.is_installed()
    assert configuration.gateway.data_dir == Path("/var/lib/plumbline")
    assert configuration.gateway.crane == "crane-7"


def test_the_shipped_environment_names_the_data_folder(etc: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = Path(__file__).parents[3] / "deploy" / "service.env"
    monkeypatch.setattr(loading, "SERVICE_ENVIRONMENT", shipped)
    assert loading.service_environment() == {"PLUMBLINE_GATEWAY__DATA_DIR": "/var/lib/plumbline"}
