"""The estimated parameters of each effect, with their intervals, and when events acted."""

from collections.abc import Iterator
from dataclasses import dataclass

from gateway.documents.format import format_time_span, format_with_interval
from gateway.documents.text import as_sentence, human_name
from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.estimates import NamedEffect
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.effect_size import components, numbers, unit_text
from gateway.twin.report.models import is_same_model


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """A parameter, or a component of one."""

    meaning: str
    name: str
    value: str
    interval: str
    unit: str
    is_plausible: bool


@dataclass(frozen=True, slots=True)
class EffectTable:
    """An effect with its parameters."""

    name: str
    is_one_of_group: bool
    explains: str
    equation: str
    rows: tuple[ParameterRow, ...]
    acted: str


@dataclass(frozen=True, slots=True)
class ParametersView:
    """The section as it is printed."""

    effects: tuple[EffectTable, ...]
    has_attempt: bool
    """No effect is named, and the final model differs from the nominal one."""


def parameters_view(result: Reconciliation) -> ParametersView:
    """Return one table for each effect."""
    attempt = not result.effects and result.log is not None and not is_same_model(result.log)
    return ParametersView(tuple(_table(effect, result) for effect in result.effects), attempt)


def _table(effect: NamedEffect, result: Reconciliation) -> EffectTable:
    return EffectTable(
        name=human_name(effect.name),
        is_one_of_group=result.verdict == "one_of" and effect.name in result.candidates,
        explains=as_sentence(effect.explains),
        equation=effect.equation,
        rows=tuple(_rows(effect)),
        acted=_acted(effect),
    )


def _acted(effect: NamedEffect) -> str:
    if effect.when_s is not None:
        return f"It acted: {format_time_span(*effect.when_s)} after the start of the recording."
    known = EFFECTS.get(effect.name)
    return "When it acted is not known." if known is not None and known.transient else "It acts all the time."


def _rows(effect: NamedEffect) -> Iterator[ParameterRow]:
    for name, estimate in effect.parameters.items():
        for component, each in zip(components(effect.name, name, estimate.value), numbers(estimate), strict=True):
            value, interval = format_with_interval(*each)
            meaning = f"{estimate.meaning}, {component}" if component else estimate.meaning
            yield ParameterRow(meaning, name, value, interval, unit_text(estimate) or "–", estimate.plausible)
