"""Records of fixed readings stay what they were: fields, texts and numbers, and old records stay readable."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from gateway.calibration.record import CalibrationRecord
from tests.gateway.calibration.golden import GOLDEN_RECORDS, golden_records

GOLDEN: dict[str, dict[str, Any]] = json.loads(GOLDEN_RECORDS.read_text())
OF_CONTENT = ("id", "sha256", "parent")
"""Follow from the last digit of every number, which depends on the linear algebra library."""


@pytest.fixture(scope="module")
def records() -> dict[str, dict[str, Any]]:
    return golden_records()


@pytest.mark.slow
def test_every_golden_record_is_made(records: dict[str, dict[str, Any]]) -> None:
    assert list(records) == list(GOLDEN)


@pytest.mark.parametrize("name", GOLDEN)
def test_a_record_of_the_same_readings_is_the_same(records: dict[str, dict[str, Any]], name: str) -> None:
    assert list(records[name]) == list(GOLDEN[name])
    for field, expected in GOLDEN[name].items():
        if field not in OF_CONTENT:
            assert_alike(records[name][field], expected)


@pytest.mark.parametrize("name", GOLDEN)
def test_a_stored_record_is_read_and_written_unchanged(name: str) -> None:
    content = GOLDEN[name]
    assert json.dumps(CalibrationRecord.model_validate(content).model_dump(mode="json")) == json.dumps(content)


def assert_alike(found: Any, expected: Any) -> None:
    """Structure, types and texts are equal; numbers agree within rounding errors of the largest of their field."""
    found_leaves, expected_leaves = list(leaves(found)), list(leaves(expected))
    assert [place for place, _ in found_leaves] == [place for place, _ in expected_leaves]
    numbers = []
    for (place, left), (_, right) in zip(found_leaves, expected_leaves, strict=True):
        if isinstance(right, float):
            numbers.append((left, right))
        else:
            assert without_hash(left) == without_hash(right), place
    if numbers:
        values = np.array(numbers)
        np.testing.assert_allclose(values[:, 0], values[:, 1], rtol=1e-7, atol=1e-9 * np.abs(values[:, 1]).max())


def leaves(content: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Every value in nested lists and objects, with its place and the name of its type."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield from leaves(value, f"{place}.{key}")
    elif isinstance(content, list):
        for number, value in enumerate(content):
            yield from leaves(value, f"{place}[{number}]")
    else:
        yield f"{place}: {type(content).__name__}", content


def without_hash(text: Any) -> Any:
    """A text without the hash in the id of a record that it names."""
    stamp = "20261121T101500Z-"
    if not isinstance(text, str) or stamp not in text:
        return text
    before, after = text.split(stamp)
    return before + stamp + after[8:]
