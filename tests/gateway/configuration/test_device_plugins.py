"""Kinds of devices from other packages: the example of the how-to page, installed as an entry point."""

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from devices.errors import DeviceError
from devices.host_clock import HostClock
from gateway.configuration.loading import ConfigurationError, to_toml, validate
from gateway.daemon.sampling.device_factory import make_device

PAGE = Path(__file__).parents[3] / "docs" / "development" / "add_a_device.md"
Install = Callable[..., None]


def example(language: str) -> str:
    (code,) = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    return str(code)


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Install a package `my_package` with the entry point of the page."""

    def write(code: str) -> None:
        metadata = tmp_path / "my_package-1.0.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n")
        (name_and_value,) = re.findall(r'^(level = ".*")$', example("toml"), flags=re.MULTILINE)
        entry = name_and_value.replace('"', "")
        (metadata / "entry_points.txt").write_text(f"[plumbline.devices]\n{entry}\n")
        (tmp_path / "my_package.py").write_text(code)
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "my_package", raising=False)

    return write


def test_the_device_of_the_page_is_configured_and_read(install: Install) -> None:
    install(example("python"))
    configuration = validate({"device": {"kind": "level", "odr_hz": 200.0}}, "test")
    assert "[device]" in to_toml(configuration)
    device = make_device(configuration, HostClock())
    info = device.open()
    assert (info.device_id, info.odr_hz) == ("level-1", 200.0)
    block = device.read()
    assert block is not None
    assert len(block) == 20
    np.testing.assert_array_equal(np.diff(block.time_ns), 5_000_000)
    device.close()


@pytest.mark.parametrize(
    ("device", "said"),
    [
        ({"kind": "level", "odr": 200.0}, r"device\.odr: unknown key; did you mean odr_hz\?"),
        ({"kind": "level", "odr_hz": -1.0}, r"device\.odr_hz: .*greater than 0"),
        ({"kind": "levle"}, "'levle' is not supported; this version has .*level"),
    ],
)
def test_its_keys_are_checked(install: Install, device: dict[str, object], said: str) -> None:
    install(example("python"))
    with pytest.raises(ConfigurationError, match=said):
        validate({"device": device}, "test")


@pytest.mark.slow
@pytest.mark.parametrize(
    "code", ["PLUGIN = 5", "raise RuntimeError('out of order')", "", "import nothing_of_this_name"]
)
def test_a_package_that_cannot_be_used_is_named_in_one_line(install: Install, code: str) -> None:
    install(code)
    with pytest.raises(ConfigurationError, match=r"device\.kind 'level': my_package:PLUGIN") as refused:
        validate({"device": {"kind": "level"}}, "test")
    assert "\n" not in str(refused.value)


def test_a_refusal_of_the_device_is_a_device_error(install: Install) -> None:
    install(
        example("python").replace(
            "self._section, self._n,", "raise ValueError('no such level')\n        self._section, self._n,"
        )
    )
    configuration = validate({"device": {"kind": "level"}}, "test")
    with pytest.raises(DeviceError, match="no such level"):
        make_device(configuration, HostClock())
