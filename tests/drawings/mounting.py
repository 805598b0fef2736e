"""The picture of the mounting: where on the rope the housing is clamped, and the clamp as it is drawn."""

from tests.drawings.clamp import draw_side
from tests.drawings.sheet import Sheet, View

ROPE_MM, ABOVE_LOAD_MM = 10_000.0, 2_500.0
"""The rope of the picture, from its upper end to the load's centre, and the housing on it."""
ZONES = (
    (0.0, 0.1, "avoid", "below a tenth: avoid, hardly any of the swing shows"),
    (0.2, 0.5, "good", "a fifth to a half: the usual place"),
    (0.5, 1.0, "high", "above: good as well, where the cable can follow"),
)
"""Shares of the rope above the load, as in the table of the guide."""
LOAD_MM, BLOCK_MM, FALL_MM = 1_400.0, 500.0, 260.0


def mounting_picture() -> str:
    """Return the picture: the crane at 1 px for 20 mm, the clamp at 1.5 px for 1 mm."""
    sheet = Sheet(900, 670)
    crane = View(sheet, (300, 610), 0.05)
    sheet.text(20, 28, "Where on the rope", kind="title")
    top = ROPE_MM
    for low, high, kind, _ in ZONES:
        crane.box((-900, 900), (low * top, high * top), kind)
    crane.box((-1_500, 1_500), (top, top + 500))
    sheet.text(crane.at(0, 0)[0], crane.at(0, top + 170)[1], "trolley", "middle")
    for x in (-FALL_MM, FALL_MM):
        crane.line((x, top), (x, BLOCK_MM + LOAD_MM / 2))
    crane.box((-420, 420), (LOAD_MM / 2 + 150, LOAD_MM / 2 + 150 + BLOCK_MM))
    crane.line((0, LOAD_MM / 2 + 150), (0, LOAD_MM / 2))
    crane.box((-LOAD_MM / 2, LOAD_MM / 2), (-LOAD_MM / 2, LOAD_MM / 2))
    x, y = crane.at(0, 0)
    sheet.text(x, y + 26, "load", "middle")
    sheet.circle(x, y, 3, "measure")
    crane.box((-FALL_MM - 60, -FALL_MM + 60), (ABOVE_LOAD_MM - 160, ABOVE_LOAD_MM + 160), "box")
    crane.up((0, top), -1_500, -90, "rope.length_m")
    crane.up((0, ABOVE_LOAD_MM), -900, -14, "above_load_m")
    for _, high, _, words in ZONES:
        sheet.text(crane.at(1_000, 0)[0], crane.at(0, high * top)[1] + 18, words)
    crane.label((-FALL_MM, top - 2_200), (410, 225), "the fall next to the dead end")
    sheet.text(560, 325, "The clamp, z up the rope", kind="title")
    clamp = View(sheet, (640, 440), 1.5)
    draw_side(clamp, (-62, 62))
    sheet.arrow(crane.at(-FALL_MM + 60, ABOVE_LOAD_MM), (555, 450))
    return sheet.svg("The housing clamped to a fall of the hoist rope, and the zones of the rope")
