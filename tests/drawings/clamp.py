"""The clamp for the hoist rope, its adjusting plate and the housing on it: dimensions in mm, and the drawing."""

from dataclasses import dataclass
from math import sqrt

from tests.drawings.sheet import Sheet, View

BLOCK_WIDTH, BLOCK_HEIGHT, BLOCK_THICKNESS = 70.0, 60.0, 25.0
BOLT_SPACING_ACROSS, BOLT_SPACING_UP, BOLT = 50.0, 40.0, 8.0
ANGLE_THICKNESS, SHELF_LENGTH = 6.0, 120.0
PLATE_LENGTH, PLATE_WIDTH, PLATE_THICKNESS, PLATE_GAP = 100.0, 60.0, 5.0, 8.0
PLATE_FROM_ANGLE, PIVOT_FROM_EDGE = 12.0, 10.0
"""Room for the bolts' heads beside the plate, and the pivot's place on it."""
LEVER, SCREW = 40.0, 3.0
"""Of the adjusting screws: what `plumbline remote align` takes for granted."""
BOX_LENGTH, BOX_WIDTH, BOX_HEIGHT = 98.0, 50.0, 35.0
LEAST_GAP = 2.0
"""Between the halves, so that they clamp the rope and not each other."""


@dataclass(frozen=True)
class Groove:
    """A V of 90 degrees in each half."""

    depth: float

    def gap(self, rope: float) -> float:
        """Return the gap between the halves on a rope of a diameter: its centre stands r sqrt(2) from the V's bottom."""
        return rope * sqrt(2) - 2 * self.depth

    def holds(self, rope: float) -> bool:
        """Do the halves clamp this rope, and touch it within the V, r / sqrt(2) from the rope's centre?"""
        return self.gap(rope) >= LEAST_GAP and self.gap(rope) / 2 <= rope / 2 / sqrt(2)


GROOVES = {Groove(6.0): (10.0, 16.0), Groove(10.0): (16.0, 28.0)}
"""The depth for each range of rope diameters."""
DRAWN_ROPE, DRAWN_GROOVE = 20.0, Groove(10.0)


def _places() -> dict[str, float]:
    """Return distances from the rope's centre along x on the drawn rope."""
    face = DRAWN_GROOVE.gap(DRAWN_ROPE) / 2
    angle = face + BLOCK_THICKNESS
    shelf = angle + ANGLE_THICKNESS
    plate = shelf + PLATE_FROM_ANGLE
    return {"face": face, "angle": angle, "shelf": shelf, "plate": plate, "pivot": plate + PIVOT_FROM_EDGE}


def draw_side(view: View, rope_up: tuple[float, float]) -> None:
    """Draw clamp, plate and housing from the side: x to the right, z up the rope."""
    at, half = _places(), BLOCK_HEIGHT / 2
    view.box((-DRAWN_ROPE / 2, DRAWN_ROPE / 2), rope_up, "rope")
    for inner, outer in ((at["face"], at["angle"]), (-at["angle"], -at["face"])):
        view.box((inner, outer), (-half, half))
    view.box((at["angle"], at["shelf"]), (-half, half))
    view.box((at["angle"], at["shelf"] + SHELF_LENGTH), (-half, -half + ANGLE_THICKNESS))
    for z in (-BOLT_SPACING_UP / 2, BOLT_SPACING_UP / 2):
        head = at["angle"] + 5
        view.box((-head - 3, -at["angle"]), (z - BOLT * 0.75, z + BOLT * 0.75))
        view.box((at["shelf"], at["shelf"] + 6), (z - BOLT * 0.75, z + BOLT * 0.75))
    shelf_top = -half + ANGLE_THICKNESS
    plate = (shelf_top + PLATE_GAP, shelf_top + PLATE_GAP + PLATE_THICKNESS)
    view.box((at["plate"], at["plate"] + PLATE_LENGTH), plate)
    view.outline(
        [(at["pivot"] - 4, shelf_top), (at["pivot"] + 4, shelf_top), (at["pivot"], plate[0])],
    )
    screw = at["pivot"] + LEVER
    view.box((screw - SCREW / 2, screw + SCREW / 2), (-half - 8, plate[0]))
    view.box((screw - 3, screw + 3), (-half - 11, -half - 8))
    box = at["plate"] + (PLATE_LENGTH - BOX_LENGTH) / 2
    view.box((box, box + BOX_LENGTH), (plate[1], plate[1] + BOX_HEIGHT), "box")
    view.box((box + BOX_LENGTH, box + BOX_LENGTH + 12), (plate[1] + 11, plate[1] + 23))
    view.sheet.arrow(view.at(box + BOX_LENGTH / 2, plate[1] + 6), view.at(box + BOX_LENGTH / 2, plate[1] + 30))
    x, y = view.at(box + BOX_LENGTH / 2, plate[1] + 20)
    view.sheet.text(x + 8, y, "z", "start", "measure")


def _draw_top(view: View) -> None:
    """Draw a section through the clamp and the plate from above: x to the right, y up."""
    at, half, depth = _places(), BLOCK_WIDTH / 2, DRAWN_GROOVE.depth
    for side in (1, -1):
        face, outer = side * at["face"], side * at["angle"]
        bottom = face + side * depth
        view.outline(
            [(face, -half), (outer, -half), (outer, half), (face, half), (face, depth), (bottom, 0), (face, -depth)]
        )
    view.circle(0, 0, DRAWN_ROPE, "rope")
    view.box((at["angle"], at["shelf"]), (-half, half))
    view.box((at["shelf"], at["shelf"] + SHELF_LENGTH), (-half, half))
    for y in (-BOLT_SPACING_ACROSS / 2, BOLT_SPACING_ACROSS / 2):
        for edge in (-BOLT / 2, BOLT / 2):
            view.line((-at["angle"], y + edge), (at["shelf"], y + edge), "hidden")
    view.box((at["plate"], at["plate"] + PLATE_LENGTH), (-PLATE_WIDTH / 2, PLATE_WIDTH / 2))
    view.circle(at["pivot"], -LEVER / 2, 6)
    view.circle(at["pivot"] + LEVER, -LEVER / 2, SCREW)
    view.circle(at["pivot"], LEVER / 2, SCREW)
    view.circle(at["pivot"] + LEVER, LEVER / 2, 4, "hidden")
    box = at["plate"] + (PLATE_LENGTH - BOX_LENGTH) / 2
    view.box((box, box + BOX_LENGTH), (-BOX_WIDTH / 2, BOX_WIDTH / 2), "hidden")


def clamp_drawing() -> str:
    """Return the drawing with dimensions, 2.6 px for a mm."""
    sheet = Sheet(860, 810)
    at, half, scale = _places(), BLOCK_HEIGHT / 2, 2.6
    side, top = View(sheet, (210, 190), scale), View(sheet, (210, 560), scale)
    end = at["shelf"] + SHELF_LENGTH
    box = f"{BOX_LENGTH:g} × {BOX_WIDTH:g} × {BOX_HEIGHT:g}"
    shelf_top = -half + ANGLE_THICKNESS
    plate_top = shelf_top + PLATE_GAP + PLATE_THICKNESS
    sheet.text(20, 28, f"From the side, on a rope of {DRAWN_ROPE:g} mm; all dimensions in mm", kind="title")
    draw_side(side, (-52, 52))
    side.up((-half, half), -at["angle"], -75)
    side.up((-BOLT_SPACING_UP / 2, BOLT_SPACING_UP / 2), -at["angle"] - 8, -22)
    side.across((at["face"], at["angle"]), half, -22)
    side.across((at["angle"], at["shelf"]), half, -52)
    side.up((plate_top, plate_top + BOX_HEIGHT), end, 40)
    side.up((shelf_top, shelf_top + PLATE_GAP), end, 78)
    side.across((at["pivot"], at["pivot"] + LEVER), -half - 12, 20, f"lever {LEVER:g}")
    side.label(
        (at["plate"] + 75, plate_top + 28),
        (520, 60),
        f"housing, about {box}; cable downwards in a loop",
    )
    side.label((at["pivot"] + LEVER, -half - 9), (540, 318), f"adjusting screw M{SCREW:g}")
    side.label((at["pivot"], shelf_top + 3), (300, 338), "pivot")
    sheet.text(20, 388, "From above, cut through the rope; the housing is dashed", kind="title")
    _draw_top(top)
    top.up((-BLOCK_WIDTH / 2, BLOCK_WIDTH / 2), -at["angle"], -75)
    top.up((-BOLT_SPACING_ACROSS / 2, BOLT_SPACING_ACROSS / 2), -at["angle"], -22)
    top.up((-LEVER / 2, LEVER / 2), end, 20, f"lever {LEVER:g}")
    top.across((at["shelf"], end), -BLOCK_WIDTH / 2, 30)
    top.across((at["pivot"], at["pivot"] + LEVER), -LEVER / 2, -34, f"lever {LEVER:g}")
    top.across((-at["face"], at["face"]), BLOCK_WIDTH / 2, -18, "gap")
    top.label((at["pivot"] + LEVER, LEVER / 2), (520, 432), "screw M4 with a spring, holds the plate down")
    top.label((at["pivot"], LEVER / 2), (330, 432), f"M{SCREW:g}")
    top.label((at["plate"] + 80, -12), (640, 690), f"plate {PLATE_LENGTH:g} × {PLATE_WIDTH:g} × {PLATE_THICKNESS:g}")
    y = 752
    sheet.text(
        20, y, f"Groove: a V of 90° in each half; gap at least {LEAST_GAP:g}. Four bolts M{BOLT:g}.", kind="title"
    )
    for number, (groove, (least, most)) in enumerate(GROOVES.items(), 1):
        words = f"rope of {least:g} to {most:g}: groove {groove.depth:g} deep, {2 * groove.depth:g} wide, gap "
        sheet.text(20, y + 20 * number, f"{words}{groove.gap(least):.1f} to {groove.gap(most):.1f}")
    return sheet.svg("Clamp and housing, from the side and from above, with dimensions in mm")
