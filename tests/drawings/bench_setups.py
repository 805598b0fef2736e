"""The set-ups of the bench methods: what stands where, which way the axes point, and what is measured."""

from itertools import pairwise
from math import cos, pi, radians, sin

from tests.drawings.sheet import Anchor, Point, Sheet, View

SENSOR_MM = 34.0
"""Edge of the sensor's housing in these pictures."""


def _turned(corner_mm: Point, centre_mm: Point, angle_deg: float) -> Point:
    x, y = corner_mm
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    return centre_mm[0] + c * x - s * y, centre_mm[1] + s * x + c * y


def _sensor(view: View, centre_mm: Point, z_deg: float, *, up: str = "z", side: str = "x") -> None:
    """Draw a sensor whose `up` axis stands at an angle to the vertical, with both axes that lie in the picture."""
    half = SENSOR_MM / 2
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    view.outline([_turned(corner, centre_mm, z_deg) for corner in corners], "box")
    words: tuple[tuple[str, Point, Anchor], ...] = (
        (up, (0.0, 2.1 * half), "middle"),
        (side, (2.1 * half, 0.0), "start"),
    )
    for name, end, anchor in words:
        view.sheet.arrow(view.at(*centre_mm), view.at(*_turned(end, centre_mm, z_deg)))
        x, y = view.at(*_turned((1.2 * end[0], 1.2 * end[1]), centre_mm, z_deg))
        view.sheet.text(x, y + 4, name, anchor, "measure")


def _sense(view: View, places_mm: list[Point]) -> None:
    """Draw the sense of a turn: a curve with a head."""
    for start, end in pairwise(places_mm[:-1]):
        view.line(start, end, "thin")
    view.sheet.arrow(view.at(*places_mm[-2]), view.at(*places_mm[-1]))


def six_faces() -> str:
    """Return the six faces of a calibration in six positions, and a pose of a norm fit."""
    sheet = Sheet(900, 260)
    sheet.text(20, 28, "Six positions: each face down once, level, still for a few seconds", kind="title")
    faces = (("z", "x", "+z up"), ("−z", "x", "−z up"), ("x", "y", "+x up"), ("−x", "y", "−x up"), ("y", "z", "+y up"))
    for place, (up, side, words) in enumerate((*faces, ("−y", "z", "−y up"))):
        view = View(sheet, (70 + 116 * place, 150), 1.3)
        view.box((-42, 42), (-SENSOR_MM / 2 - 8, -SENSOR_MM / 2), "part")
        _sensor(view, (0, 0), 0, up=up, side=side)
        sheet.text(70 + 116 * place, 212, words, "middle")
    sheet.text(75, 240, "a plane that is level to 0.1° (--placement-deg); the order is free")
    view = View(sheet, (815, 150), 1.3)
    _sensor(view, (-12, -6), 35)
    sheet.text(815, 212, "norm fit: twelve poses,", "middle")
    sheet.text(815, 230, "by hand, level or not", "middle")
    return sheet.svg("The faces of a six-position calibration")


def rotation_rig() -> str:
    """Return the rig of a rotation calibration: a turn about y, and the dial."""
    sheet = Sheet(900, 430)
    sheet.text(20, 28, "A turn about y, seen along the rotation axis", kind="title")
    dial = View(sheet, (230, 225), 1.6)
    dial.circle(0, 0, 160)
    for angle_deg in range(0, 360, 10):
        inner = 70 if angle_deg % 90 else 64
        along = (sin(radians(angle_deg)), cos(radians(angle_deg)))
        dial.line((inner * along[0], inner * along[1]), (80 * along[0], 80 * along[1]))
    _sensor(dial, (0, 0), 0)
    stops: tuple[tuple[str, Point, Anchor], ...] = (("0°: z up", (0, 86), "middle"), ("90°: x up", (-86, 0), "end"))
    for words, place, anchor in stops:
        sheet.text(dial.at(*place)[0], dial.at(*place)[1] + 4, words, anchor)
    _sense(dial, [_turned((58.0, 0.0), (0, 0), angle) for angle in range(100, 171, 10)])
    sheet.text(480, 28, "The same from the side", kind="title")
    side = View(sheet, (620, 225), 1.6)
    side.box((-110, -96), (-95, 70), "part")
    side.box((-130, -60), (-103, -95), "part")
    side.box((-96, -20), (-6, 6), "rope")
    side.box((-20, -12), (-30, 30), "part")
    side.box((-12, 22), (-17, 17), "box")
    side.line((-125, 0), (80, 0), "hidden")
    sheet.arrow(side.at(5, 0), side.at(5, 46))
    sheet.text(side.at(5, 52)[0], side.at(5, 52)[1], "z", "middle", "measure")
    side.label((60, 0), (640, 290), "rotation axis: horizontal to 2°,")
    sheet.text(640, 308, "along y of the sensor")
    sheet.text(
        20, 415, "12 stops or more over the full circle, better 36; then a turn about x, z up at 0° and y at 90°"
    )
    return sheet.svg("The rig of a rotation calibration")


def laser_platform() -> str:
    """Return the platform with laser and sensor, the board of dots and the camera."""
    sheet = Sheet(900, 380)
    sheet.text(20, 28, "Laser and sensor on one platform, a board at the distance L", kind="title")
    rig = View(sheet, (130, 250), 1.0)
    tilt_deg = 5.0
    plate = [(-90.0, -5.0), (90.0, -5.0), (90.0, 5.0), (-90.0, 5.0)]
    rig.outline([_turned(corner, (0, 0), tilt_deg) for corner in plate])
    rig.outline([(-14, -60), (14, -60), (0, -5)])
    rig.line((-60, -60), (60, -60))
    laser = [(0.0, 6.0), (80.0, 6.0), (80.0, 22.0), (0.0, 22.0)]
    rig.outline([_turned(corner, (0, 0), tilt_deg) for corner in laser], "rope")
    _sensor(rig, _turned((-50, 23), (0, 0), tilt_deg), tilt_deg)
    board_mm = 520.0
    begin = _turned((80, 14), (0, 0), tilt_deg)
    hit = begin[1] + (board_mm - begin[0]) * sin(radians(tilt_deg)) / cos(radians(tilt_deg))
    rig.line(begin, (board_mm, hit), "thin")
    rig.line((80, 14), (board_mm, 14), "hidden")
    rig.box((board_mm, board_mm + 8), (-70, 110), "part")
    rig.up((14, hit), board_mm + 8, 22, "d")
    rig.across((0, board_mm), -60, 40, "L, from the rotation axis to the board: measure it twice")
    rig.label((0, -2), (30, 345), "rotation axis")
    rig.label(_turned((40, 22), (0, 0), tilt_deg), (150, 165), "laser")
    front = View(sheet, (780, 230), 0.8)
    front.box((-85, 85), (-100, 100), "part")
    for column in range(7):
        for row in range(7):
            front.circle(24 * (column - 3), 24 * (row - 3), 11, "hidden")
    front.circle(3, -38, 7, "measure")
    front.circle(3, 20, 7, "measure")
    front.up((-38, 20), 85, 12, "d")
    sheet.text(780, 138, "the board, as the camera sees it", "middle")
    sheet.text(780, 340, "first photograph: the zero", "middle")
    sheet.text(780, 358, "measure the pitch of the print", "middle")
    return sheet.svg("Laser, sensor and board of a single-parameter calibration")


def alignment_shaft() -> str:
    """Return the housing on a horizontal shaft, and the screws that tilt the sensor in it."""
    sheet = Sheet(900, 330)
    sheet.text(20, 28, "The housing on a horizontal shaft that is parallel to the axis to be aligned", kind="title")
    view = View(sheet, (300, 190), 1.6)
    for at in (-120, 112):
        view.box((at, at + 8), (-60, 12), "part")
    view.line((-150, -60), (150, -60))
    view.box((-140, 140), (-5, 5), "rope")
    view.outline([(-60, -34), (60, -34), (60, 34), (-60, 34)], "part")
    tilt_deg = 7.0
    board = [(-42.0, -5.0), (42.0, -5.0), (42.0, 5.0), (-42.0, 5.0)]
    view.outline([_turned(corner, (0, 6), tilt_deg) for corner in board], "box")
    for screw in (-34, 34):
        view.box((screw - 2, screw + 2), (6 + 0.12 * screw, 44), "rope")
        view.box((screw - 5, screw + 5), (44, 49), "rope")
    view.line((-90, 6), (95, 6), "hidden")
    view.line((0, 6), _turned((92, 0), (0, 6), tilt_deg), "thin")
    x, y = view.at(97, 14)
    sheet.text(x, y, "e: tilt of the axis", "start", "measure")
    view.label((34, 48), (430, 95), "adjusting screws")
    view.label((-130, 0), (20, 120), "shaft, level")
    _sense(view, [(-150 + 9 * cos(place * pi / 8), 22 * sin(place * pi / 8)) for place in range(-5, 6)])
    sheet.text(
        20,
        312,
        "Turn slowly, 20 s or more a turn: the axis then reads e times the reading of the other axis, once a turn.",
    )
    sheet.text(620, 180, "first the screw that the advice names,")
    sheet.text(620, 198, "then a full turn, then the next one")
    return sheet.svg("A housing on a horizontal shaft for the alignment of its sensor")


def thermal_chamber() -> str:
    """Return the sensor in a chamber, and the course of its temperature."""
    sheet = Sheet(900, 330)
    sheet.text(20, 28, "One recording for each face, the temperature up or down by 10 °C or more", kind="title")
    view = View(sheet, (190, 190), 1.5)
    view.box((-100, 100), (-70, 80), "part")
    view.outline([(-84, -54), (84, -54), (84, 64), (-84, 64)], "high")
    view.box((-50, 50), (-40, -26), "rope")
    _sensor(view, (0, -26 + SENSOR_MM / 2), 0)
    sheet.text(20, 322, "a chamber, or an oven that cools: slowly, without a fan that shakes")
    view.label((40, -33), (345, 250), "a heavy plate, level")
    view.label((8, 0), (345, 215), "its own thermometer is read;")
    sheet.text(345, 233, "a slow change keeps it close")
    plot = View(sheet, (570, 270), 1.0)
    sheet.arrow(plot.at(0, 0), plot.at(265, 0))
    sheet.arrow(plot.at(0, 0), plot.at(0, 190))
    sheet.text(840, 288, "time", "end", "measure")
    sheet.text(576, 78, "temperature", "start", "measure")
    course: list[Point] = [(10, 30), (40, 30), (130, 150), (150, 150), (240, 40), (255, 40)]
    for start, end in pairwise(course):
        plot.line(start, end)
    plot.up((40, 150), 240, 22, "10 °C")
    sheet.text(570, 312, "up and down shows a lag and a hysteresis")
    return sheet.svg("A sensor on one face in a chamber, and the course of its temperature")


def girder_ends() -> str:
    """Return a girder that sags under a trolley, with a sensor at each end."""
    sheet = Sheet(900, 340)
    sheet.text(20, 28, "A sensor at each end of the girder; the zero is taken unloaded", kind="title")
    view = View(sheet, (450, 150), 1.0)
    half = 360.0
    sag: list[Point] = [(x, -46 * cos(pi / 2 * x / half)) for x in range(-360, 361, 20)]
    upper, lower = [(x, y + 9) for x, y in sag], [(x, y - 9) for x, y in reversed(sag)]
    view.outline([*upper, *lower], "part")
    view.line((-half, 0), (half, 0), "hidden")
    for x in (-half, half):
        view.outline([(x - 16, -42), (x + 16, -42), (x, -9)], "rope")
    view.box((-48, 48), (-33, -20), "rope")
    for x in (-36, 36):
        view.circle(x, -37, 14)
        sheet.arrow(view.at(x, -46), view.at(x, -92))
    view.across((0.0, 36.0), -46, 66, "b")
    for at, slope in ((-half + 40, -11.0), (half - 40, 11.0)):
        _sensor(view, (at, 24), slope, side="inward" if at < 0 else "outward")
    view.across((0, half), -46, 104, "l, half the span")
    view.up((-46, 0), 120, 26, "δ")
    view.label((-half + 3, 2), (20, 235), "angle between the girder and its zero: Δθ")
    sheet.text(20, 328, "--left-axis and --right-axis name the axis of each housing that points to mid-span.")
    return sheet.svg("A girder with a sensor at each end")


def installed_housing() -> str:
    """Return the housing on its rope, at rest and in a swing, and the place that the swings show."""
    sheet = Sheet(900, 400)
    sheet.text(20, 28, "The housing stays on its single rope: free swings, each with a rest close to it", kind="title")
    rope_mm, place_mm, swing_deg = 280.0, 140.0, 14.0
    for at_px, angle_deg, words in ((200.0, 0.0, "a rest"), (560.0, swing_deg, "a free swing, six periods or more")):
        view = View(sheet, (at_px, 60), 1.0)
        pivot = (0.0, 0.0)

        def along(reach_mm: float, beside_mm: float = 0.0, angle_deg: float = angle_deg) -> Point:
            return _turned((beside_mm, -reach_mm), (0.0, 0.0), angle_deg)

        view.box((-60, 60), (0, 10), "part")
        view.line(pivot, (0.0, -rope_mm - 30), "hidden")
        view.line(pivot, along(rope_mm))
        view.outline(
            [along(rope_mm, -26), along(rope_mm, 26), along(rope_mm + 34, 26), along(rope_mm + 34, -26)], "rope"
        )
        _sensor(view, along(place_mm, SENSOR_MM / 2 + 3), angle_deg)
        sheet.text(at_px, 390, words, "middle")
        if angle_deg:
            _sense(view, [_turned((0.0, -rope_mm + 30), (0.0, 0.0), each) for each in range(-12, 10, 3)])
        else:
            view.up((-rope_mm - 17, -place_mm), -30, -60, "above the load")
            view.label(along(rope_mm + 17, 0), (250, 350), "the load's centre")
    sheet.text(700, 150, "several directions,")
    sheet.text(700, 168, "0.7 to 14 degrees,")
    sheet.text(700, 186, "nothing hoisted or moved")
    return sheet.svg("A housing on its rope, at rest and in a free swing")
