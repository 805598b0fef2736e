"""The Jinja2 environment: every value is escaped, and a missing value is an error."""

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.documents.figures import PALETTE
from gateway.documents.format import (
    REPLACEMENT,
    as_sentence,
    format_number,
    format_p_value,
    format_percent,
    format_short,
    format_time_span,
    human_name,
    join_names,
    printable_text,
)

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATES = Path(__file__).parent / "templates"
UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters
    "\u200e\u200f\u202a-\u202e\u2066-\u2069"  # characters that change the direction of writing
    "\ud800-\udfff]"  # halves of characters, as a file name may hold them
)
COORDINATE_DIGITS = 6
"""Basis: a millionth of a figure's width is below any pixel."""


def render(template: str, **view: object) -> str:
    """Return the text of a template with the values of a view."""
    return environment().get_template(template).render(view)


@cache
def environment() -> "Environment":
    """Return the only environment.

    Jinja2 is imported here, at the first document, so that a daemon that writes none never loads it.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    made = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_finalize,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        auto_reload=False,
    )
    made.globals |= {"palette": PALETTE, "time_span": format_time_span}
    made.filters |= {
        "number": format_number,
        "short": format_short,
        "percent": format_percent,
        "p_value": format_p_value,
        "words": human_name,
        "names": join_names,
        "sentence": as_sentence,
        "printable": printable_text,
    }
    return made


def _finalize(value: object) -> object:
    """Return a value as it is written: None is refused, a float is a coordinate, text has no unprintable characters."""
    if value is None:
        raise TypeError("a template got None where it needs text")
    if isinstance(value, float):
        return f"{value:.{COORDINATE_DIGITS}g}"
    if isinstance(value, str) and not hasattr(value, "__html__"):
        return UNSAFE.sub(REPLACEMENT, value)
    return value
