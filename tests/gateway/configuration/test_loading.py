"""The configuration, also the installed one: what is accepted, and what the refusal says."""

import tomllib
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from gateway.configuration import loading
from gateway.configuration.loading import ConfigurationError, load, to_toml, validate
from gateway.configuration.model import Configuration

REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "wrong unit": ({"rope": {"length_mm": 3000}}, "rope.length_mm: unknown key; did you mean length_m?"),
    "unknown section": ({"ropes": {}}, "ropes: unknown key; did you mean rope?"),
    "nested key": ({"bus": {"tls": {"cert": "x"}}}, "bus.tls.cert: unknown key; did you mean certificate?"),
    "unknown device": (
        {"device": {"kind": "adxl999"}},
        "device.kind: 'adxl999' is not supported; this version has simulated,",
    ),
    "impossible rate": ({"device": {"kind": "adxl355", "odr_hz": 100}}, "no rate of 100 Hz; nearest is 125"),
    "missing key": ({"device": {"kind": "witmotion"}}, "device.port: is missing"),
    "text for a number": ({"rope": {"length_m": "12 m"}}, "rope.length_m: Input should be a valid number"),
    "not a section": ({"rope": 5}, "rope: "),
    "two places": ({"housing": {"position_m": 1, "above_load_m": 2}}, "keep one"),
    "beyond the load": ({"housing": {"position_m": 99}}, "housing.position_m 99 is beyond rope.length_m 12"),
    "mirror image": ({"device": {"axes_map": "x,y,-z"}}, "left-handed"),
    "limits out of order": ({"alerts": {"clear_deg": 5}}, "clear_deg 5 <= warn_deg 4 <= trip_deg 6 must hold"),
    "cutoff beyond the rate": (
        {"device": {"odr_hz": 4}, "filter": {"cutoff_hz": 2}},
        "filter.cutoff_hz 2 must stay below 1.6",
    ),
    "not a number": ({"alerts": {"hold_s": float("nan")}}, "alerts.hold_s"),
    "a blank in a key": ({"gateway": {"crane": "crane 1"}}, "gateway.crane"),
    "a wildcard in a key": ({"gateway": {"site": "**"}}, "gateway.site"),
    "page without a port": ({"page": {"listen": "localhost"}}, "page.listen"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_refusal_names_the_key_and_the_remedy(case: str) -> None:
    table, expected = REFUSED[case]
    with pytest.raises(ConfigurationError) as refused:
        validate(table, "my.toml")
    text = str(refused.value)
    assert text.startswith("my.toml: ")
    assert expected in text
    assert "\n" not in text


def test_printed_default_is_the_default() -> None:
    assert validate(tomllib.loads(to_toml(Configuration())), "printed") == Configuration()


def test_every_key_of_the_published_interface_exists() -> None:
    keys = {
        "gateway": "site crane sensor data_dir",
        "rope": "length_m",
        "housing": "position_m above_load_m",
        "site": "gravity_m_s2 latitude_deg altitude_m",
        "filter": "cutoff_hz order",
        "alerts": "warn_deg trip_deg clear_deg hold_s lean_trip_deg stale_s",
        "recorder": "segment_s quota_mb fsync_s pre_event_s post_event_s",
        "bus": "mode connect listen tls",
        "page": "enabled listen",
    }
    for section, names in keys.items():
        annotation = Configuration.model_fields[section].annotation
        assert isinstance(annotation, type)
        assert issubclass(annotation, BaseModel)
        assert set(names.split()) <= set(annotation.model_fields)


def test_environment_overrides_the_file(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text("[rope]\nlength_m = 20\n")
    environment = {
        "PLUMBLINE_ROPE__LENGTH_M": "30.5",
        "PLUMBLINE_GATEWAY__CRANE": "north",
        "HOME": "/",
        "PLUMBLINE_X": "1",
    }
    configuration = load(path, environment)
    assert (configuration.rope.length_m, configuration.gateway.crane) == (30.5, "north")


def test_a_wrong_environment_variable_is_named() -> None:
    with pytest.raises(ConfigurationError, match="PLUMBLINE_ROPE__LENGTH_M"):
        load(None, {"PLUMBLINE_ROPE__LENGTH_M": "-1"})


@pytest.mark.parametrize(
    ("content", "expected"),
    [(b"[rope", "is not TOML"), (b"\xff\xfe\x00", "is not UTF-8"), (None, "no such file")],
)
def test_a_file_that_is_not_toml_is_refused(tmp_path: Path, content: bytes | None, expected: str) -> None:
    path = tmp_path / "my.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigurationError, match=expected):
        load(path, {})


def test_gravity_by_latitude() -> None:
    """WGS 84 normal gravity: 9.780325 at the equator, 9.832185 at the pole."""
    equator = validate({"site": {"latitude_deg": 0}}, "x").site.local_gravity_m_s2
    pole = validate({"site": {"latitude_deg": 90}}, "x").site.local_gravity_m_s2
    assert equator == pytest.approx(9.780325, abs=1e-6)
    assert pole == pytest.approx(9.832185, abs=1e-6)


def test_axes_map() -> None:
    assert validate({"device": {"axes_map": "-y, x, z"}}, "x").device.axes == ((1, -1), (0, 1), (2, 1))


def test_the_housing_position_from_either_end() -> None:
    assert validate({"rope": {"length_m": 10}, "housing": {"above_load_m": 3}}, "x").housing_position_m == 7
    assert validate({"housing": {"position_m": 3}}, "x").housing_position_m == 3
    assert validate({"device": {"kind": "adxl355"}}, "x").housing_position_m is None
    assert validate({"rope": {"length_m": 20}}, "x").housing_position_m == 15  # a simulated housing hangs somewhere


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
