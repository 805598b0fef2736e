"""`plumbline config check` of files whose parts are elsewhere."""

import json
from pathlib import Path

import pytest

from gateway import languages
from gateway.cli.main import main

GERMAN = '[page]\nlanguage = "de"\n'


def test_texts_that_a_language_lacks_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    configuration, file = tmp_path / "my.toml", tmp_path / "de.json"
    configuration.write_text(GERMAN)
    assert main(["config", "check", str(configuration)]) == 0
    texts = languages.read_texts("de")
    del texts["word_OK"], texts["cancel"]
    file.write_text(json.dumps(texts))
    monkeypatch.setitem(languages._FILES, "de", file)
    capsys.readouterr()
    assert main(["config", "check", str(configuration)]) == 2
    assert f"{configuration}: page.language: de.json lacks word_OK, cancel" in capsys.readouterr().err
