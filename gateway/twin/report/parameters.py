"""The numbers that were found, with their intervals, and when events acted."""

from collections.abc import Iterator

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Value
from gateway.twin.reconcile.output.result import Estimate, NamedEffect, Reconciliation
from gateway.twin.report.markup import Html, element, joined, missing, paragraph, section, table
from gateway.twin.report.models import same
from gateway.twin.report.words import plain, sentence, span, with_interval

HEAD = ("parameter", "value", "95 % interval", "unit", "physically")


def parameters_part(result: Reconciliation) -> Html:
    """One table for each effect."""
    title, name = "What was found, in numbers", "parameters"
    if not result.effects:
        return section(title, missing("No effect was named, so there are no parameters."), _attempt(result), name=name)
    return section(title, *(_effect(effect, result) for effect in result.effects), name=name)


def _attempt(result: Reconciliation) -> Html:
    """Values that were fitted and are no answer stand elsewhere."""
    if result.log is None or same(result.log):
        return Html("")
    return paragraph("What was fitted for the pictures stands under “The model, before and after”, without any claim.")


def _effect(effect: NamedEffect, result: Reconciliation) -> Html:
    title = plain(effect.name)
    if result.verdict == "one_of" and effect.name in result.candidates:
        title += " – one of the group, as fitted; not an answer by itself"
    return joined(
        [
            element("h3", title),
            paragraph(sentence(effect.explains)),
            paragraph(element("code", effect.equation)),
            table(HEAD, _rows(effect), numbers=(1, 2)) if effect.parameters else missing("It has no parameters."),
            paragraph(_when(effect)),
        ]
    )


def _when(effect: NamedEffect) -> str:
    if effect.when_s is not None:
        return f"It acted: {span(*effect.when_s)} after the start of the recording."
    known = EFFECTS.get(effect.name)
    return "When it acted is not known." if known is not None and known.transient else "It acts all the time."


def _rows(effect: NamedEffect) -> Iterator[tuple[str, ...]]:
    for name, estimate in effect.parameters.items():
        values = zip(
            _components(effect.name, name, estimate.value),
            _each(estimate.value),
            _each(estimate.ci95[0]),
            _each(estimate.ci95[1]),
            strict=True,
        )
        for component, value, low, high in values:
            shown, interval = with_interval(value, low, high)
            yield _meaning(name, component, estimate), shown, interval, _unit(estimate), _plausible(estimate)


def _meaning(name: str, component: str, estimate: Estimate) -> Html:
    return joined([f"{estimate.meaning}{component} ", element("code", name)])


def _unit(estimate: Estimate) -> str:
    return "–" if estimate.unit in {"", "1"} else estimate.unit


def _plausible(estimate: Estimate) -> Html:
    if estimate.plausible:
        return element("span", "plausible")
    return element("span", "doubtful: at the edge of what is possible", class_="tag bad")


def _each(value: Value) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


def _components(effect: str, parameter: str, value: Value) -> tuple[str, ...]:
    """`, x`, `, y` where a parameter has components."""
    if not isinstance(value, tuple):
        return ("",)
    known = (
        next((p.components for p in EFFECTS[effect].parameters if p.name == parameter), ()) if effect in EFFECTS else ()
    )
    names = known if len(known) == len(value) else tuple(str(i) for i in range(1, len(value) + 1))
    return tuple(f", {each}" for each in names)
