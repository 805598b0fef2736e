"""The equations of the model before and after."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.twin.effects.parameter import Value
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.models import caution, final_model_name


@dataclass(frozen=True, slots=True)
class Equation:
    """A line of a model."""

    text: str
    is_new: bool = False


@dataclass(frozen=True, slots=True)
class EquationsView:
    """The section as it is printed."""

    caution: str
    before: tuple[Equation, ...]
    after_name: str
    after: tuple[Equation, ...]
    tables: tuple[tuple[str, ...], ...]
    """Lines of each `[model.*]` table of the model after."""


def equations_view(result: Reconciliation) -> EquationsView:
    """Return both models; equations that the nominal model lacks are marked as new."""
    return EquationsView(
        caution=caution(result),
        before=tuple(Equation(text) for text in result.equations_before),
        after_name=final_model_name(result),
        after=tuple(Equation(text, text not in result.equations_before) for text in result.equations_after),
        tables=tuple(_table(name, values) for name, values in result.model.items()),
    )


def _table(name: str, values: Mapping[str, Value]) -> tuple[str, ...]:
    return (f"[model.{name}]", *(f"{key} = {_number(value)}" for key, value in values.items()))


def _number(value: Value) -> str:
    return f"[{', '.join(f'{each:.6g}' for each in value)}]" if isinstance(value, tuple) else f"{value:.6g}"
