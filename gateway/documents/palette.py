"""The colours of all documents, for the style sheet and for figures. Line colours: Okabe and Ito 2008, for all eyes."""

INK = "#1a1a1a"
FAINT = "#5a5f66"
LINE = "#c9ced4"
MEASURED = "#949aa1"
BEFORE = "#d55e00"
AFTER = "#0072b2"
SHADE = "#f0e442"
EVENT = "#a3357a"
ALARM = "#b00012"

PALETTE = {
    "ink": INK,
    "faint": FAINT,
    "line": LINE,
    "after": AFTER,
    "before": BEFORE,
    "event": EVENT,
    "measured": MEASURED,
    "alarm": ALARM,
}
"""The colours that the style sheet uses, by the names of its custom properties."""
