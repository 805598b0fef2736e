"""The model before and after, as equations."""

from collections.abc import Mapping

from gateway.twin.effects.effect import Value
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.markup import Html, element, items, joined, missing, paragraph, section
from gateway.twin.report.models import caution, final_name

SYMBOLS = (
    ("n", "direction of the rope, from the pivot to the load; a vector of length 1"),
    ("L, r", "how far the load’s centre and the housing are from the pivot"),
    ("g", "gravity; in the equations of motion a vector that points down"),
    ("a_p", "acceleration of the pivot; 0 unless an effect moves it"),
    ("F/m", "other forces on the load, over its mass; 0 unless an effect makes one"),
    ("v", "velocity of the load"),
    ("f, f_s", "specific force at the housing, and what the sensor makes of it where that differs"),
    ("I, ᵀ", "the identity matrix; transposed"),
    ("′, ″", "rate of change with time, and its rate of change"),
    ("others", "parameters of the effect, listed with what was found"),
)


def equations_part(result: Reconciliation) -> Html:
    """Side by side; what is new is marked by a word and by colour."""
    new = [line for line in result.equations_after if line not in result.equations_before]
    return section(
        "The model, before and after",
        paragraph(caution(result)) if caution(result) else "",
        element(
            "div",
            element("div", element("h3", "Before: as believed"), _lines(result.equations_before, [])),
            element("div", element("h3", f"After: {final_name(result)}"), _lines(result.equations_after, new)),
            class_="models",
        ),
        _symbols() if result.equations_before or result.equations_after else "",
        element("h3", "The effects of the model after, as the rig’s description takes them"),
        _tables(result.model),
        name="model",
    )


def _symbols() -> Html:
    return joined(
        [
            element("h3", "Symbols"),
            items(joined([element("code", symbol), f": {meaning}"]) for symbol, meaning in SYMBOLS),
        ]
    )


def _lines(equations: tuple[str, ...], new: list[str]) -> Html:
    if not equations:
        return missing("No equations were recorded.")
    return element("ul", *(_line(each, is_new=each in new) for each in equations))


def _line(equation: str, *, is_new: bool) -> Html:
    if is_new:
        return element("li", element("span", "new ", class_="mark"), element("code", equation), class_="new")
    return element("li", element("code", equation))


def _tables(model: Mapping[str, Mapping[str, Value]]) -> Html:
    if not model:
        return missing("None: the model is the pendulum alone.")
    return joined(element("p", element("code", _table(name, values))) for name, values in model.items())


def _table(name: str, values: Mapping[str, Value]) -> Html:
    return joined([f"[model.{name}]", *(f"{key} = {_number(value)}" for key, value in values.items())], Html("<br>"))


def _number(value: Value) -> str:
    return f"[{', '.join(f'{each:.6g}' for each in value)}]" if isinstance(value, tuple) else f"{value:.6g}"
