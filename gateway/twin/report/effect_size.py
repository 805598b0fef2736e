"""The size of an effect: its parameters with intervals and units."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from gateway.documents.format import format_with_interval, human_name
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Value
from gateway.twin.reconcile.output.estimates import Estimate, NamedEffect

UNIT_SUFFIX = re.compile(r"(^|_)(m_s2|m_s|rad_s|deg_s|per_s|per_m|mg_per_c|hz|deg|rad|g|m|s)$")


@dataclass(frozen=True, slots=True)
class Size:
    """A number that says how large an effect is, as it is printed."""

    label: str
    value: str
    interval: str
    """95 %."""
    unit: str
    """Empty for a pure number."""


def effect_sizes(effect: NamedEffect) -> tuple[Size, ...]:
    """Return the estimated parameters that say how large an effect is, not when it acted or with which phase."""
    known = EFFECTS.get(effect.name)
    refitted = {parameter.name for parameter in known.parameters if parameter.refitted} if known else set()
    return tuple(
        size
        for name, estimate in effect.parameters.items()
        if name not in refitted and not (estimate.unit == "s" and effect.when_s is not None)
        for size in _sizes(effect.name, name, estimate)
    )


def _components(effect: str, parameter: str, value: Value) -> tuple[str, ...]:
    """Return the names of a parameter's components; one empty name where it has none."""
    if not isinstance(value, tuple):
        return ("",)
    known = (
        next((p.components for p in EFFECTS[effect].parameters if p.name == parameter), ()) if effect in EFFECTS else ()
    )
    return known if len(known) == len(value) else tuple(str(i) for i in range(1, len(value) + 1))


def unit_text(estimate: Estimate) -> str:
    """Return a unit; empty for a pure number."""
    return "" if estimate.unit == "1" else estimate.unit


def component_texts(effect: str, name: str, estimate: Estimate) -> Iterator[tuple[str, str, str]]:
    """Yield the name, value and 95 % interval of each component of a parameter."""
    numbers = zip(_each(estimate.value), _each(estimate.ci95[0]), _each(estimate.ci95[1]), strict=True)
    for component, each in zip(_components(effect, name, estimate.value), numbers, strict=True):
        yield component, *format_with_interval(*each)


def _sizes(effect: str, name: str, estimate: Estimate) -> Iterator[Size]:
    short_name = human_name(UNIT_SUFFIX.sub("", name))
    for component, value, interval in component_texts(effect, name, estimate):
        yield Size(" ".join(filter(None, (short_name, component))), value, interval, unit_text(estimate))


def _each(value: Value) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)
