"""The residual plot as inline SVG: every pose against its own uncertainty and the record's prediction interval."""

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.element import element, short
from gateway.certificate.figures import significant
from gateway.certificate.residuals import Residual, residuals

WIDTH, HEIGHT = 380.0, 190.0
LEFT, RIGHT, TOP, BOTTOM = 44.0, 372.0, 10.0, 160.0
MOST_POSES = 160
MOST_LABELS = 14
BAND_SHOWN = 4.0
"""The prediction interval is drawn where it is at most so many times the residuals; else it would hide them."""


def residual_section(record: CalibrationRecord) -> Element:
    """The plot with its caption."""
    title = element("h2", "Residual of each pose")
    found = residuals(record)[:MOST_POSES]
    if not found:
        return element("section", title, element("p", "The record holds no poses that can be shown.", class_="missing"))
    used = [residual for residual in found if residual.used]
    beyond = sum(residual.ratio > 3 for residual in used)
    caption = (
        f"|m| − 1 g after the correction, rms {_rms_mg(used)} mg. Bars: ± 2 u (type A of the pose); {beyond} of {len(used)} used "
        f"poses beyond 3 u. Hollow: not used. {_of_the_fit(record)}"
    )
    if len(found) < len(record.poses):
        caption += f" {len(record.poses) - len(found)} poses are not shown."
    return element("section", title, _picture(found, 1000 * float(record.prediction_interval_g)), element("p", caption))


def _rms_mg(used: list[Residual]) -> str:
    return significant(1000 * math.sqrt(sum(r.residual_g**2 for r in used) / len(used)) if used else None)


def _of_the_fit(record: CalibrationRecord) -> str:
    """Six positions are fitted to where the faces should point: what is left of that is mostly how they lay."""
    if record.method != "six-position" or record.residual_rms_g is None:
        return ""
    return f"Against the faces as they should lie the fit leaves {significant(1000 * float(record.residual_rms_g))} mg rms."


def _picture(found: tuple[Residual, ...], dm_mg: float) -> Element:
    reach_mg = max(1000 * (abs(residual.residual_g) + 2 * residual.u_g) for residual in found) or dm_mg
    banded = dm_mg <= BAND_SHOWN * reach_mg
    half_mg = 1.12 * (max(reach_mg, dm_mg) if banded else reach_mg)
    picture = element(
        "svg", viewBox=f"0 0 {WIDTH:g} {HEIGHT:g}", class_="plot", role="img", aria_label="residual of each pose in mg"
    )
    picture.extend(_scale(half_mg))
    picture.extend(_band(dm_mg, half_mg, banded))
    every = math.ceil(len(found) / MOST_LABELS)
    for place, residual in enumerate(found):
        x = LEFT + (place + 0.5) * (RIGHT - LEFT) / len(found)
        picture.extend(_pose(residual, x, half_mg))
        if place % every == 0:
            label = str(residual.number) if residual.face is None else f"{residual.number} {short(residual.face, 3)}"
            picture.append(element("text", label, x=x, y=BOTTOM + 12, class_="tick middle"))
    picture.append(
        element("text", "pose, and the face that was up", x=(LEFT + RIGHT) / 2, y=HEIGHT - 4, class_="tick middle")
    )
    return picture


def _y(value_mg: float, half_mg: float) -> float:
    return (TOP + BOTTOM) / 2 - value_mg / half_mg * (BOTTOM - TOP) / 2


def _scale(half_mg: float) -> Iterator[Element]:
    yield element("rect", x=LEFT, y=TOP, width=RIGHT - LEFT, height=BOTTOM - TOP, class_="frame")
    step = _step(half_mg)
    for count in range(-math.floor(half_mg / step), math.floor(half_mg / step) + 1):
        y = _y(count * step, half_mg)
        yield element("line", x1=LEFT, x2=RIGHT, y1=y, y2=y, class_="zero" if count == 0 else "grid")
        yield element("text", f"{count * step:g}", x=LEFT - 4, y=y + 3, class_="tick end")
    middle = (TOP + BOTTOM) / 2
    yield element("text", "mg", x=10, y=middle, class_="tick middle")


def _band(dm_mg: float, half_mg: float, banded: bool) -> Iterator[Element]:
    if not banded:
        text = f"dm = ± {significant(dm_mg)} mg lies outside this picture"
        yield element("text", text, x=RIGHT - 4, y=TOP + 11, class_="tick end")
        return
    for side in (-1, 1):
        y = _y(side * dm_mg, half_mg)
        yield element("line", x1=LEFT, x2=RIGHT, y1=y, y2=y, class_="dm")
    yield element("text", f"± dm = {significant(dm_mg)} mg", x=RIGHT - 4, y=_y(dm_mg, half_mg) + 11, class_="tick end")


def _pose(residual: Residual, x: float, half_mg: float) -> Iterator[Element]:
    value_mg, u_mg = 1000 * residual.residual_g, 1000 * residual.u_g
    group = element("g", class_="pose" if residual.used else "pose unused", data_pose=residual.number)
    group.append(
        element(
            "line", x1=x, x2=x, y1=_y(value_mg - 2 * u_mg, half_mg), y2=_y(value_mg + 2 * u_mg, half_mg), class_="bar"
        )
    )
    group.append(element("title", f"pose {residual.number}: {significant(value_mg)} mg, u {significant(u_mg)} mg"))
    group.append(element("circle", cx=x, cy=_y(value_mg, half_mg), r=2.6))
    yield group


def _step(half: float) -> float:
    """A round step that makes three to seven lines on either side of zero, or fewer."""
    power = 10.0 ** math.floor(math.log10(half / 2))
    return next(power * factor for factor in (1, 2, 5, 10) if half / (power * factor) < 3.5)
