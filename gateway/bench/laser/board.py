"""The board, a lattice of round dots of known pitch, as a printable sheet at true size, and the map from a photograph to it.

The map is perspective and radial distortion of the lens, fitted to the dots. It gives every place its local scale, where
Zhu et al. 2020 (eq. 16 to 18) take that of the two nearest dots for a whole segment.
"""

from dataclasses import dataclass
from datetime import UTC, datetime

import cv2
import numpy as np
from fpdf import FPDF
from numpy.typing import NDArray

from gateway.bench.laser.least_squares import fit_least_squares, jacobian
from gateway.errors import InputError
from gateway.numerics.array import Array

N_MAP_PARAMETERS = 10
"""Eight of the perspective, two of the distortion. Definition: of the map."""
DOT_OUTLIER_SIGMA = 5.0
"""A dot with a residual of so many robust standard deviations is not used. Basis: dirt, or a hand, covers a part of it."""
MIN_OUTLIER_PITCH = 0.002
"""Least residual of an outlier, pitches. Basis: a choice; 0.04 mm at a pitch of 20 mm, below the accuracy of a print."""
INVERSE_ITERATIONS = 30
"""Iterations of the inverse of the distortion. Basis: a choice; a distortion of some per cent converges by that factor in
each."""
PAPER_MM = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
"""Width and height (ISO 216)."""
MARGIN_MM = 8.0
"""Margin of the paper that printers leave white. Basis: space for the text below the lattice."""
TEXT_MM = 16.0
"""Height of the text below the lattice. Basis: its lines."""
CHECK_MM = 100.0
"""Length of the line by which the scale of the print is checked. Basis: a choice; a ruler reads it to half a per cent, and A4 has
room."""
CREATED = datetime(2000, 1, 1, tzinfo=UTC)
"""Fixed, so that the same board gives the same file."""


@dataclass(frozen=True, slots=True)
class DotBoard:
    """Layout of a board, by default that of Zhu et al. 2020, table 6."""

    columns: int = 7
    rows: int = 7
    pitch_m: float = 0.040
    """Distance between the centres of neighbouring dots."""
    dot_m: float = 0.020
    """Diameter of a dot."""
    u_pitch_m: float = 0.005e-3 / np.sqrt(3)
    """Standard uncertainty of the pitch, common to the whole board."""

    def node_m(self, index: Array) -> Array:
        """Return positions of lattice nodes (column, row), shape (n, 2): x to the right, y down, origin in the middle."""
        return np.asarray((index - (np.array([self.columns, self.rows]) - 1) / 2) * self.pitch_m)


@dataclass(frozen=True, slots=True)
class BoardMap:
    """Map from pixels to lattice coordinates (column, row)."""

    parameters: Array
    """Perspective h11, h12, ... h32 of normalised coordinates, then the distortion k1, k2; shape (10,)."""
    covariance: Array
    centre_px: Array
    half_diagonal_px: float
    residual_rms: float
    """Of the used dots, pitches."""
    used: NDArray[np.bool_]
    """Which of the dots the fit uses."""

    def to_board(self, pixel: Array) -> Array:
        """Return lattice coordinates of pixels, shape (n, 2)."""
        return _apply(self.parameters, (pixel - self.centre_px) / self.half_diagonal_px)

    def derivative(self, pixel: Array) -> Array:
        """Return the derivatives of the lattice coordinates by the pixel's, shape (2, 2)."""
        return jacobian(lambda place: self.to_board(place[None])[0], pixel, np.full(2, self.half_diagonal_px))

    def to_pixel(self, board: Array) -> Array:
        """Return the pixel of one place in lattice coordinates, shape (2,), by Newton's method from the image's centre."""
        pixel = self.centre_px.copy()
        for _ in range(INVERSE_ITERATIONS):
            step = np.linalg.solve(self.derivative(pixel), board - self.to_board(pixel[None])[0])
            pixel = pixel + step
            if np.abs(step).max() < 1e-9 * self.half_diagonal_px:
                break
        return pixel

    def map_covariance(self, pixel: Array) -> Array:
        """Return the covariance of the lattice coordinates of a pixel that the fit of the map causes, shape (2, 2)."""
        normalised = (pixel[None] - self.centre_px) / self.half_diagonal_px
        slope = jacobian(lambda values: _apply(values, normalised)[0], self.parameters, _scale(self.parameters))
        return np.asarray(slope @ self.covariance @ slope.T)


def fit_board_map(pixel: Array, index: Array, shape: tuple[int, int]) -> BoardMap | None:
    """Fit the map to centres of dots, shape (n, 2), with their lattice indices; None if they do not determine it.

    `shape` is height and width of the photograph, whose centre is taken for that of the lens.
    """
    height, width = shape
    centre = np.array([width - 1, height - 1]) / 2
    half_diagonal = float(np.hypot(*centre))
    normalised = (pixel - centre) / half_diagonal
    used = np.ones(len(pixel), dtype=bool)
    for _ in range(2):
        fit = _fit(normalised[used], index[used])
        if fit is None:
            return None
        parameters, covariance = fit
        residual = np.hypot(*(_apply(parameters, normalised) - index).T)
        limit = max(DOT_OUTLIER_SIGMA * 1.2 * float(np.median(residual[used])), MIN_OUTLIER_PITCH)
        if np.array_equal(residual <= limit, used):
            break
        used = residual <= limit
    rms = float(np.sqrt(np.mean(residual[used] ** 2)))
    return BoardMap(parameters, covariance, centre, half_diagonal, rms, used)


def find_perspective(start: Array, end: Array, method: int = 0, tolerance: float = 0.0) -> Array | None:
    """Return the perspective from places to places, each (n, 2), with 1 as its last entry; None if there is none."""
    found: object = cv2.findHomography(start, end, method, tolerance)[0]
    if not isinstance(found, np.ndarray) or found[2, 2] == 0:
        return None
    return np.asarray(found / found[2, 2], dtype=np.float64)


def _fit(normalised: Array, index: Array) -> tuple[Array, Array] | None:
    if 2 * len(index) <= N_MAP_PARAMETERS:
        return None
    perspective = find_perspective(normalised, index)
    if perspective is None:
        return None
    start = np.append(perspective.ravel()[:8], [0.0, 0.0])
    fit = fit_least_squares(lambda values: (_apply(values, normalised) - index).ravel(), start, _scale(start))
    return None if fit is None else (fit.parameters, fit.covariance)


def _scale(parameters: Array) -> Array:
    """Return the magnitudes of the parameters, for derivatives."""
    return np.asarray(np.maximum(np.abs(parameters), [1, 1, 1, 1, 1, 1, 0.1, 0.1, 0.1, 0.1]))


def _apply(parameters: Array, normalised: Array) -> Array:
    # By columns: sums and products over an axis of length two take several times as long.
    x, y = normalised[:, 0], normalised[:, 1]
    h11, h12, h13, h21, h22, h23, h31, h32, k1, k2 = parameters.tolist()
    r2 = x**2 + y**2
    stretch = 1 + r2 * (k1 + k2 * r2)
    x, y = x * stretch, y * stretch
    bottom = h31 * x + h32 * y + 1
    place = np.empty((len(x), 2))
    np.divide(h11 * x + h12 * y + h13, bottom, out=place[:, 0])
    np.divide(h21 * x + h22 * y + h23, bottom, out=place[:, 1])
    return place


def board_pdf(board: DotBoard) -> bytes:
    """Return a PDF of one sheet. Raises `InputError` if the board fits no paper up to A0."""
    size_mm = (
        1000 * np.array([board.columns, board.rows]) * board.pitch_m
    )  # half a pitch of white around the outer dots' centres
    paper = next((name for name in PAPER_MM if _fits(size_mm, PAPER_MM[name])), None)
    if paper is None:
        raise InputError(
            f"a board of {size_mm[0]:.0f} x {size_mm[1]:.0f} mm fits no paper up to A0; take a smaller --pitch-mm"
        )
    width_mm, height_mm = PAPER_MM[paper]
    page = FPDF(orientation="portrait", unit="mm", format=(width_mm, height_mm))
    page.set_creation_date(CREATED)
    page.set_auto_page_break(False)
    page.add_page()
    page.set_fill_color(0)
    middle = np.array([width_mm, height_mm - TEXT_MM]) / 2
    columns, rows = np.meshgrid(np.arange(board.columns), np.arange(board.rows))
    for x, y in middle + 1000 * board.node_m(np.column_stack([columns.ravel(), rows.ravel()])):
        page.circle(x=float(x), y=float(y), radius=500 * board.dot_m, style="F")
    _write_scale(page, board, width_mm, height_mm)
    return bytes(page.output())


def _fits(size_mm: np.ndarray, paper_mm: tuple[float, float]) -> bool:
    return bool(size_mm[0] + 2 * MARGIN_MM <= paper_mm[0] and size_mm[1] + 2 * MARGIN_MM + TEXT_MM <= paper_mm[1])


def _write_scale(page: FPDF, board: DotBoard, width_mm: float, height_mm: float) -> None:
    """Draw the line to check the print, and the options that describe the board."""
    left, line_mm = (width_mm - CHECK_MM) / 2, height_mm - MARGIN_MM - TEXT_MM / 2
    page.set_line_width(0.2)
    page.line(left, line_mm, left + CHECK_MM, line_mm)
    for x in (left, left + CHECK_MM):
        page.line(x, line_mm - 2, x, line_mm + 2)
    page.set_font("helvetica", size=8)
    page.set_xy(MARGIN_MM, line_mm + 2)
    options = (
        f"--lattice {board.columns}x{board.rows} --pitch-mm {1000 * board.pitch_m:g} --dot-mm {1000 * board.dot_m:g}"
    )
    text = (
        f"The line is {CHECK_MM:g} mm long: print at 100 %, measure several pitches, give what you measure. {options}"
    )
    page.cell(w=width_mm - 2 * MARGIN_MM, h=4, text=text, align="C")
