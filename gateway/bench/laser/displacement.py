"""Displacement of the laser spot from the first photograph, which is the zero, to each other one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.bench.laser.board import BoardMap, DotBoard, fit_board_map
from gateway.bench.laser.dots import DotCandidates, find_candidates, find_edges, index_lattice, measure_centre
from gateway.bench.laser.photograph import Photograph, to_light
from gateway.bench.laser.spot import WINDOW_SIGMAS, LaserSpot, find_spot
from gateway.calibration.record import NotDeterminedError
from gateway.numerics.array import Array

MAX_HIDDEN = 0.25
"""Largest share of dots that may be hidden. Basis: a choice; a hand or a rope hides less, and the rest still covers the board."""
CENTRE_PASSES = 2
"""Passes in which the centres are measured on the board by the map of the pass before."""
MARGIN_PITCHES = 0.5
"""Width of the strip around the outer dots in which the spot may be. Basis: a choice; the map is extrapolated by less than the
distance of two dots."""
CLEAR_PITCHES = 0.5
"""Distance from a dot's middle to the outside of its white ring, for dots of up to two thirds of the pitch. Definition: of the
board as it is printed."""
MAX_RESIDUAL_PITCH = 0.002
"""Largest residual of the map, pitches. Basis: flat boards leave 0.0001 to 0.0006, as JPEG of quality 75 at 2 pixels per mm
0.0012; a bent board that leaves this puts the spot wrong by about a tenth of a millimetre at a pitch of 40 mm."""
MAX_TURN_DEG = 30.0
"""Largest change of the board's direction between photographs. Basis: with a quarter turn the lattice would look the same."""


@dataclass(frozen=True, slots=True)
class MeasuredPhotograph:
    """What was found in one photograph."""

    photograph: Photograph
    board: DotBoard
    """With columns and rows as they lie in the photograph."""
    dots_px: Array
    """Centres, shape (n, 2)."""
    index: NDArray[np.int64]
    """Columns and rows, shape (n, 2)."""
    board_map: BoardMap
    spot: LaserSpot
    spot_m: Array
    """Position of the spot on the board, x to the right, y down, origin in the middle; shape (2,)."""
    covariance_m2: Array
    """Shape (2, 2)."""


@dataclass(frozen=True, slots=True)
class ScaledSegment:
    """A part of the line from the zero to the spot, between two lattice lines (Zhu et al. 2020, eq. 16 to 18)."""

    length_m: float
    length_px: float

    @property
    def scale_m(self) -> float:
        """Local scale, m per px."""
        return self.length_m / self.length_px


@dataclass(frozen=True, slots=True)
class Displacement:
    """Displacement of the spot in one photograph."""

    d_m: float
    """Distance on the board; positive up, or to the right where it is nearer to level, in the photograph."""
    u_d_m: float
    segments: tuple[ScaledSegment, ...]
    """From the zero to the spot; empty for the zero itself."""


def measure_photograph(photograph: Photograph, board: DotBoard) -> MeasuredPhotograph:
    """Find board and spot. Raises `NotDeterminedError` that names the photograph and the remedy.

    The board is found in the channel that does not see the laser. The map for the spot is that of the laser's channel, because a
    lens images each colour at another scale; the dots near the spot are left out of it.
    """
    candidates, numbers, index = _find_lattice(photograph, board)
    columns, rows = (index.max(axis=0) + 1).tolist()
    board = replace(board, columns=columns, rows=rows)
    light = to_light(photograph.board)
    dots_px, kept, board_map = _measure_dots(photograph, light, candidates, numbers, index)
    _check_map(photograph, board_map, board)
    dot_px = float(np.median(candidates.diameter_px[numbers]))
    edges = find_edges(light, dots_px, dot_px, board_map)
    region = _board_region(board_map, board, photograph.laser.shape)
    spot = find_spot(photograph, region, edges)
    far = _far_from(spot, board_map, index)
    first_map = board_map
    dots_px, kept, board_map = _measure_dots(
        photograph, to_light(photograph.laser), candidates, numbers[far], index[far], first_map
    )
    _check_map(photograph, board_map, board)
    fringe_px = spot.centre_px - first_map.to_pixel(board_map.to_board(spot.centre_px[None])[0])
    spot = find_spot(photograph, region, replace(edges, board_map=board_map), fringe_px)
    place = board_map.to_board(spot.centre_px[None])
    slope = board_map.derivative(spot.centre_px)
    unflat = board_map.residual_rms**2 * np.eye(2)  # neighbouring dots share it, so more dots do not average it out
    covariance = slope @ spot.covariance_px2 @ slope.T + board_map.map_covariance(spot.centre_px) + unflat
    return MeasuredPhotograph(
        photograph,
        board,
        dots_px,
        index[far][kept],
        board_map,
        spot,
        board.node_m(place)[0],
        covariance * board.pitch_m**2,
    )


def check_different(photographs: Sequence[MeasuredPhotograph]) -> None:
    """Raise `NotDeterminedError` for two photographs with the same centres to the last digit: noise differs in each exposure."""
    seen: dict[bytes, Path] = {}
    for each in photographs:
        earlier = seen.setdefault(each.spot.centre_px.tobytes(), each.photograph.path)
        if earlier is not each.photograph.path:
            raise NotDeterminedError(
                f"{each.photograph.path}: is the same photograph as {earlier}; give each one once, the zero first"
            )


def displacement(zero: MeasuredPhotograph, moved: MeasuredPhotograph) -> Displacement:
    """Return the displacement between two photographs. Raises `NotDeterminedError` if the board was turned in between."""
    turn_deg = np.degrees(_direction(moved) - _direction(zero))
    if abs((turn_deg + 180) % 360 - 180) > MAX_TURN_DEG:
        raise NotDeterminedError(
            f"{moved.photograph.path}: the board is turned by {turn_deg:.0f} deg since the first photograph; "
            "hold the camera alike"
        )
    step = moved.spot_m - zero.spot_m
    length = float(np.hypot(*step))
    along = step / length if length else np.array([0.0, -1.0])
    sign = np.sign(-along[1]) if abs(along[1]) >= abs(along[0]) else np.sign(along[0])
    variance = float(along @ (zero.covariance_m2 + moved.covariance_m2) @ along)
    u_scale = moved.board.u_pitch_m / moved.board.pitch_m * length
    segments = () if moved is zero else _segments(zero.spot_m, moved)
    return Displacement(float(sign) * length, 0.0 if moved is zero else float(np.sqrt(variance + u_scale**2)), segments)


def _find_lattice(
    photograph: Photograph, board: DotBoard
) -> tuple[DotCandidates, NDArray[np.int64], NDArray[np.int64]]:
    """Return candidates, the numbers of those on the lattice, and their indices, for the first window that shows the board."""
    seen = (0, 0)
    for candidates in find_candidates(photograph.board):
        numbers, index = index_lattice(candidates)
        if len(index) == 0:
            continue
        size = (int(index[:, 0].max()) + 1, int(index[:, 1].max()) + 1)
        complete = len(index) >= (1 - MAX_HIDDEN) * board.columns * board.rows
        if complete and size in ((board.columns, board.rows), (board.rows, board.columns)):
            return candidates, numbers, index
        seen = max(seen, size, key=lambda shape: shape[0] * shape[1])
    found = f"a lattice of {seen[0]} x {seen[1]} dots" if min(seen) else "no lattice of dots"
    raise NotDeterminedError(
        f"{photograph.path}: {found}, the board has {board.columns} x {board.rows}; show the whole board, sharp, its dots "
        "uncovered, or give its --lattice"
    )


def _measure_dots(
    photograph: Photograph,
    light: NDArray[np.float32],
    candidates: DotCandidates,
    numbers: NDArray[np.int64],
    index: NDArray[np.int64],
    board_map: BoardMap | None = None,
) -> tuple[Array, NDArray[np.bool_], BoardMap]:
    """Return the centres, which of the lattice's dots they belong to, and the map; a first map saves a pass."""
    for _ in range(CENTRE_PASSES if board_map else 1 + CENTRE_PASSES):
        measured = [
            measure_centre(light, candidates.centre_px[number], float(candidates.diameter_px[number]), board_map)
            for number in numbers.tolist()
        ]
        kept = np.array([centre is not None for centre in measured], dtype=np.bool_)
        centres = np.array([centre for centre in measured if centre is not None]).reshape(-1, 2)
        board_map = fit_board_map(centres, index[kept].astype(np.float64), light.shape)
        if board_map is None:
            break
    if board_map is None:
        raise NotDeterminedError(f"{photograph.path}: too few dots to measure; show the whole board with a margin")
    return centres, kept, board_map


def _far_from(spot: LaserSpot, board_map: BoardMap, index: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which dots the spot does not brighten, edges and white ring included."""
    place = board_map.to_board(spot.centre_px[None])[0]
    sigma_pitches = spot.sigma_px[0] * np.sqrt(abs(np.linalg.det(board_map.derivative(spot.centre_px))))
    return np.asarray(np.hypot(*(index - place).T) > CLEAR_PITCHES + WINDOW_SIGMAS * sigma_pitches)


def _check_map(photograph: Photograph, board_map: BoardMap, board: DotBoard) -> None:
    if board_map.residual_rms > MAX_RESIDUAL_PITCH or board_map.used.mean() < 1 - MAX_HIDDEN:
        raise NotDeterminedError(
            f"{photograph.path}: the dots lie {1000 * board_map.residual_rms * board.pitch_m:.2f} mm rms off a flat lattice; "
            "flatten the board, or take the photograph sharper"
        )


def _board_region(board_map: BoardMap, board: DotBoard, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return the pixels that show the lattice and the strip around it, shape (height, width)."""
    low, high = -MARGIN_PITCHES, np.array([board.columns, board.rows]) - 1 + MARGIN_PITCHES
    sides = np.linspace(0, 1, 12, endpoint=False)
    corners = np.array([[low, low], [high[0], low], [high[0], high[1]], [low, high[1]]])
    outline = np.concatenate(
        [one + sides[:, None] * (other - one) for one, other in zip(corners, np.roll(corners, -1, 0), strict=True)]
    )
    pixels = np.array([board_map.to_pixel(place) for place in outline])
    region = np.zeros(shape, dtype=np.uint8)
    cv2.fillPoly(region, [np.rint(pixels).astype(np.int32)], 1)
    return region.astype(bool)


def _direction(measured: MeasuredPhotograph) -> float:
    """Return the direction of the rows in the photograph, rad."""
    centre = np.mean(measured.dots_px, axis=0)
    along = np.linalg.solve(measured.board_map.derivative(centre), [1.0, 0.0])
    return float(np.arctan2(along[1], along[0]))


def _segments(start_m: Array, moved: MeasuredPhotograph) -> tuple[ScaledSegment, ...]:
    """Cut the line from the zero to the spot at the lattice lines that it crosses."""
    board = moved.board
    middle = (np.array([board.columns, board.rows]) - 1) / 2
    start, end = (place / board.pitch_m + middle for place in (start_m, moved.spot_m))
    axis = int(np.argmax(np.abs(end - start)))
    low, high = sorted((start[axis], end[axis]))
    shares = (
        [(line - start[axis]) / (end[axis] - start[axis]) for line in np.arange(np.ceil(low), high)]
        if high > low
        else []
    )
    places = [start + share * (end - start) for share in sorted({0.0, *map(float, shares), 1.0})]
    pixels = [moved.board_map.to_pixel(place) for place in places]
    return tuple(
        ScaledSegment(float(np.hypot(*(other - one))) * board.pitch_m, float(np.hypot(*(far - near))))
        for one, other, near, far in zip(places, places[1:], pixels, pixels[1:], strict=False)
    )
