"""The Prometheus text format 0.0.4: families of samples with labels."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
METRIC_PREFIX = "plumbline_"
Value = float | int | bool | None
"""None: not known, and left out."""
Labels = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Family:
    """All samples of one metric."""

    name: str
    kind: Literal["gauge", "counter"]
    text: str
    samples: tuple[tuple[Labels, Value], ...]


def gauge(name: str, text: str, value: Value) -> Family:
    """Return a gauge without labels."""
    return Family(METRIC_PREFIX + name, "gauge", text, (({}, value),))


def labelled_gauge(name: str, label: str, text: str, values: Mapping[str, Value]) -> Family:
    """Return a gauge with one sample for each value of a label."""
    return Family(METRIC_PREFIX + name, "gauge", text, tuple(({label: key}, value) for key, value in values.items()))


def state_gauge(name: str, label: str, text: str, states: Sequence[str], present: str) -> Family:
    """Return a gauge that is 1 at the present state and 0 at the others."""
    return labelled_gauge(name, label, text, {state: state == present for state in states})


def info_gauge(name: str, text: str, labels: Labels) -> Family:
    """Return a gauge that is always 1 and states its labels."""
    return Family(f"{METRIC_PREFIX}{name}_info", "gauge", text, ((labels, 1),))


def counter(name: str, text: str, value: int | None) -> Family:
    """Return a counter without labels."""
    return Family(f"{METRIC_PREFIX}{name}_total", "counter", text, (({}, value),))


def labelled_counter(name: str, label: str, text: str, counts: Mapping[str, int]) -> Family:
    """Return a counter with one sample for each value of a label."""
    samples = tuple(({label: key}, count) for key, count in counts.items())
    return Family(f"{METRIC_PREFIX}{name}_total", "counter", text, samples)


def with_labels(families: Iterable[Family], labels: Labels) -> Iterator[Family]:
    """Add labels to every sample."""
    for family in families:
        samples = tuple(({**labels, **own}, value) for own, value in family.samples)
        yield replace(family, samples=samples)


def render(families: Iterable[Family]) -> str:
    """Return the text; families of one name become one group, as the format demands. Unknown values are left out."""
    groups: dict[str, Family] = {}
    for family in families:
        before = groups.get(family.name)
        groups[family.name] = family if before is None else replace(before, samples=(*before.samples, *family.samples))
    lines: list[str] = []
    for family in groups.values():
        samples = [_sample(family.name, labels, value) for labels, value in family.samples if value is not None]
        if samples:
            lines += [f"# HELP {family.name} {family.text}", f"# TYPE {family.name} {family.kind}", *samples]
    return "\n".join(lines) + "\n"


def _sample(name: str, labels: Labels, value: float | bool) -> str:
    inside = ",".join(f'{label}="{_escape(text)}"' for label, text in labels.items())
    return f"{name}{{{inside}}} {value:g}" if isinstance(value, bool) else f"{name}{{{inside}}} {value!r}"


def _escape(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
