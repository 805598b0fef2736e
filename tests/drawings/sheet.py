"""A sheet of SVG on which parts are drawn in mm, with dimensions and labels."""

from dataclasses import dataclass, field
from html import escape
from typing import Literal

Point = tuple[float, float]
Anchor = Literal["start", "middle", "end"]
STYLE = (
    "text{font:13px sans-serif;fill:#111} .title{font-weight:bold} .part{fill:#dfe5ea;stroke:#111;stroke-width:1.5} "
    ".box{fill:#f6e7c1;stroke:#111;stroke-width:1.5} .rope{fill:#9aa3ab;stroke:#111;stroke-width:1} "
    ".avoid{fill:#f3cfc9} .good{fill:#bfe3bf} .high{fill:#e0f1e0} .line{stroke:#111;stroke-width:1.5;fill:none} "
    ".hidden{stroke:#111;stroke-width:1;stroke-dasharray:5 3;fill:none} "
    ".thin{stroke:#1f4f8f;stroke-width:1;fill:none} .measure{fill:#1f4f8f}"
)
ARROW_PX = 7.0


@dataclass
class Sheet:
    """A drawing under way; y points up, as on the crane."""

    width_px: float
    height_px: float
    elements: list[str] = field(default_factory=list)

    def text(self, x: float, y: float, words: str, anchor: Anchor = "start", kind: str = "") -> None:
        """Write a label, its foot at a place in px."""
        self.elements.append(
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" class="{kind}">{escape(words)}</text>'
        )

    def path(self, points: list[Point], kind: str, *, closed: bool = False) -> None:
        """Draw a line or an outline through places in px."""
        lines = " L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        self.elements.append(f'<path d="M{lines}{" Z" if closed else ""}" class="{kind}"/>')

    def circle(self, x: float, y: float, radius_px: float, kind: str) -> None:
        """Draw a circle."""
        self.elements.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius_px:.1f}" class="{kind}"/>')

    def arrow(self, tail: Point, head: Point) -> None:
        """Draw a thin line with a head at its end."""
        (x, y), (to_x, to_y) = tail, head
        length = ((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5
        along, across = (to_x - x) / length, (to_y - y) / length
        wing = ARROW_PX * 0.4
        corners = [
            (to_x - ARROW_PX * along - side * wing * across, to_y - ARROW_PX * across + side * wing * along)
            for side in (1, -1)
        ]
        self.path([tail, head], "thin")
        self.path([head, *corners], "measure", closed=True)

    def svg(self, title: str) -> str:
        """Return the drawing as a file."""
        size = f"{self.width_px:.0f} {self.height_px:.0f}"
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" role="img"><title>{escape(title)}</title>'
        paper = f'<rect width="{self.width_px:.0f}" height="{self.height_px:.0f}" fill="#fff"/>'
        return "\n".join([head, f"<style>{STYLE}</style>", paper, *self.elements, "</svg>"]) + "\n"


@dataclass(frozen=True)
class View:
    """A view on a sheet: places in mm from an origin on the sheet."""

    sheet: Sheet
    origin_px: Point
    px_per_mm: float

    def at(self, x_mm: float, y_mm: float) -> Point:
        """Return the place on the sheet."""
        return self.origin_px[0] + x_mm * self.px_per_mm, self.origin_px[1] - y_mm * self.px_per_mm

    def box(self, x_mm: tuple[float, float], y_mm: tuple[float, float], kind: str = "part") -> None:
        """Draw a rectangle."""
        (left, right), (low, high) = x_mm, y_mm
        self.outline([(left, low), (right, low), (right, high), (left, high)], kind)

    def outline(self, corners_mm: list[Point], kind: str = "part") -> None:
        """Draw a closed shape."""
        self.sheet.path([self.at(*corner) for corner in corners_mm], kind, closed=True)

    def line(self, start_mm: Point, end_mm: Point, kind: str = "line") -> None:
        """Draw a line."""
        self.sheet.path([self.at(*start_mm), self.at(*end_mm)], kind)

    def circle(self, x_mm: float, y_mm: float, diameter_mm: float, kind: str = "line") -> None:
        """Draw a circle."""
        self.sheet.circle(*self.at(x_mm, y_mm), diameter_mm / 2 * self.px_per_mm, kind)

    def across(self, x_mm: tuple[float, float], y_mm: float, line_px: float, words: str = "") -> None:
        """Dimension a width: from the parts at a height to a line so many px below it (above it, if negative)."""
        (left, y), (right, _) = self.at(x_mm[0], y_mm), self.at(x_mm[1], y_mm)
        level = y + line_px
        for x in (left, right):
            self.sheet.path([(x, y), (x, level + (4 if line_px > 0 else -4))], "thin")
        middle = (left + right) / 2
        words = words or f"{x_mm[1] - x_mm[0]:g}"
        if right - left > 8 * len(words):
            self.sheet.arrow((middle, level), (left, level))
            self.sheet.arrow((middle, level), (right, level))
            self.sheet.text(middle, level - 4, words, "middle", "measure")
        else:
            self.sheet.arrow((left - 22, level), (left, level))
            self.sheet.arrow((right + 22, level), (right, level))
            self.sheet.text(right + 26, level + 4, words, "start", "measure")

    def up(self, y_mm: tuple[float, float], x_mm: float, line_px: float, words: str = "") -> None:
        """Dimension a height: from the parts at a place to a line so many px to the right of it (left, if negative)."""
        (x, low), (_, high) = self.at(x_mm, y_mm[0]), self.at(x_mm, y_mm[1])
        level = x + line_px
        for y in (low, high):
            self.sheet.path([(x, y), (level + (4 if line_px > 0 else -4), y)], "thin")
        middle = (low + high) / 2
        words = words or f"{y_mm[1] - y_mm[0]:g}"
        anchor: Anchor = "start" if line_px > 0 else "end"
        beside = level + (6 if line_px > 0 else -6)
        if low - high > 24:
            self.sheet.arrow((level, middle), (level, low))
            self.sheet.arrow((level, middle), (level, high))
        else:
            self.sheet.arrow((level, low + 20), (level, low))
            self.sheet.arrow((level, high - 20), (level, high))
        self.sheet.text(beside, middle + 4, words, anchor, "measure")

    def label(self, place_mm: Point, text_px: Point, words: str, anchor: Anchor = "start") -> None:
        """Name a part: words at a place on the sheet, and a line to the part."""
        away = -4 if anchor == "start" else 4
        self.sheet.path([self.at(*place_mm), (text_px[0] + away, text_px[1] - 4)], "thin")
        self.sheet.circle(*self.at(*place_mm), 2, "measure")
        self.sheet.text(*text_px, words, anchor)
