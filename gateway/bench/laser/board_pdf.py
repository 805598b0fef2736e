"""A printable board at true size."""

from datetime import UTC, datetime

import numpy as np
from fpdf import FPDF

from gateway.bench.laser.board import DotBoard
from gateway.errors import InputError

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
