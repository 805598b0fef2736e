"""Round dark dots in a photograph: their centres to a fraction of a pixel, their blurred edges, their column and row.

Some dots may be hidden, and the board may be turned whichever way.
"""

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.bench.laser.board import BoardMap, find_perspective
from gateway.numerics.array import Array

WORKING_SIDE_PX = 1600
"""Longer photographs are reduced to find the dots; their centres are measured in the full one. Basis: a choice; a dot of a board
that fills a quarter of it still has ten pixels, and the search takes a moment."""
WINDOW_SHARES = (8, 16, 4)
"""Shares of the shorter side that are tried as the window of the adaptive threshold; it must exceed a dot. Basis: a choice; from
a board that fills the photograph to one at a distance."""
MIN_CONTRAST = 12
"""Least darkness of a dot against the mean of its window, values of 255. Basis: a choice; above the noise of a camera, below any
print in shade."""
MIN_AREA_PX = 40
"""Least area of a dot. Basis: a choice; seven pixels across, below which a shape is not known."""
MAX_AREA_DIFFERENCE = 0.12
"""Largest relative difference between a dot's area and that of the ellipse through its edge. Basis: a choice; the edge of a dot
of seven pixels is uncertain by as much, and letters differ by more."""
MIN_AXIS_RATIO = 0.4
"""Least ratio of the ellipse's axes. Basis: a board that leans by 66 degrees."""
SIZE_FACTOR = 1.7
"""Ratio of diameters within which candidates are dots of one board. Basis: a choice; perspective changes dots by less across a
board, and letters differ by more."""
RIM_RADII = 1.25
"""Radius of the area whose darkness counts, and inner radius of the white ring around a dot, radii. Basis: a choice; outside the
blurred edge, inside the ring."""
RING_RADII = 1.5
"""Outer radius of the white ring, radii. Definition: of the board as it is printed, for dots of up to two thirds of the pitch."""
CORE_RADII = 0.6
"""Radius of the area that gives a dot's black, radii. Basis: a choice; inside the blurred edge of the smallest dot."""
SMOOTHING_PX = 1.0
"""Smoothing before edges and spot are measured, standard deviation. Basis: a choice; it makes the blur Gaussian and the noise
small, and a dot of seven pixels remains."""
SIGMAS_10_TO_90 = 2.563
"""Width of a blurred edge between 10 and 90 %, standard deviations. Definition: two quantiles of a normal distribution."""
NEIGHBOUR_SHARE = 0.25
"""Largest distance of a neighbour from where the last step leads, steps. Basis: a choice; perspective changes a step by less, and
half a step is the next candidate."""
NODE_SHARE = 0.2
"""Largest distance of a dot from a node of the fitted lattice, pitches. Basis: a choice; distortion moves a dot by less, and half
a pitch is the next node."""
MIN_DOTS = 12
"""Basis: a choice; 24 coordinates for the ten parameters of the map."""
SEED_DOTS = 6
"""Number of dots, from the middle outwards, from which the lattice is grown until it is complete. Basis: a choice; a dot that is
none seldom begins all of them, and growth from one finds the rest."""
MAX_DIRECTION_COSINE = np.cos(np.radians(60))
"""Largest cosine of the angle between the two directions of the lattice. Basis: a choice; a board that leans by 60 degrees keeps
its directions as far apart."""
Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class DotCandidates:
    """Ellipses that may be dots."""

    centre_px: Array
    """Shape (n, 2)."""
    diameter_px: Array
    """Geometric mean of the axes, shape (n,)."""


def find_candidates(board: NDArray[np.uint8]) -> list[DotCandidates]:
    """Return the candidates for each window of the threshold; `board` is a channel of a photograph."""
    factor = min(1.0, WORKING_SIDE_PX / max(board.shape))
    small = board if factor == 1 else cv2.resize(board, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(np.asarray(small, dtype=np.uint8), (0, 0), 1.0)
    found = []
    for share in WINDOW_SHARES:
        window = min(small.shape) // share | 1
        dark = cv2.adaptiveThreshold(
            small, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, max(window, 3), MIN_CONTRAST
        )
        candidates = _ellipses(np.asarray(dark, dtype=np.uint8))
        centre = (candidates[:, :2] + 0.5) / factor - 0.5
        found.append(_of_one_size(DotCandidates(centre, candidates[:, 2] / factor)))
    return found


def _ellipses(dark: NDArray[np.uint8]) -> Array:
    """Return centre and diameter of the round regions, shape (n, 3)."""
    contours, _ = cv2.findContours(dark, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    rows = []
    for contour in contours:
        if len(contour) < 12 or cv2.contourArea(contour) < MIN_AREA_PX:
            continue
        (x, y), (first, second), _ = cv2.fitEllipse(contour)
        area = np.pi / 4 * first * second
        if min(first, second) < MIN_AXIS_RATIO * max(first, second):
            continue
        if abs(cv2.contourArea(contour) / area - 1) <= MAX_AREA_DIFFERENCE:
            rows.append((x, y, float(np.sqrt(first * second))))
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _of_one_size(candidates: DotCandidates) -> DotCandidates:
    """Return the largest group of candidates of similar diameter."""
    diameters = candidates.diameter_px
    if len(diameters) == 0:
        return candidates
    ratio = diameters[:, None] / diameters
    near = (ratio < SIZE_FACTOR) & (ratio > 1 / SIZE_FACTOR)
    group = near[np.argmax(near.sum(axis=1))]
    return DotCandidates(candidates.centre_px[group], diameters[group])


def measure_centre(
    light: NDArray[np.float32], centre_px: Array, diameter_px: float, board_map: BoardMap | None
) -> Array | None:
    """Return the centroid of a dot's darkness (Zhu et al. 2020, eq. 14 and 15), shape (2,); None near the photograph's edge.

    Darkness is counted between the white ring around the dot, fitted by a plane because light is uneven, and the dot's own black.
    With a map, the centroid is that on the board: in the photograph, perspective moves it away from the image of the centre.
    """
    radius = diameter_px / 2
    reach = int(np.ceil(RING_RADII * radius)) + 1
    column, row = (round(float(value)) for value in centre_px)
    height, width = light.shape
    if column < reach or row < reach or column + reach >= width or row + reach >= height:
        return None
    y, x = np.mgrid[row - reach : row + reach + 1, column - reach : column + reach + 1].astype(np.float64)
    window = light[row - reach : row + reach + 1, column - reach : column + reach + 1].astype(np.float64)
    dx, dy = x - centre_px[0], y - centre_px[1]
    distance = np.hypot(dx, dy) / radius
    ring = (distance > RIM_RADII) & (distance < RING_RADII)
    plane = np.linalg.lstsq(np.column_stack([np.ones(ring.sum()), dx[ring], dy[ring]]), window[ring], rcond=None)[0]
    white = plane[0] + plane[1] * dx + plane[2] * dy
    black_share = float(np.median((window / white)[distance < CORE_RADII]))
    inside = distance < RIM_RADII
    darkness = ((1 - window / white) / (1 - black_share))[inside]
    pixel = np.column_stack([x[inside], y[inside]])
    if board_map is None:
        return np.asarray(darkness @ pixel / darkness.sum())
    return _board_centroid(pixel, darkness, board_map)


def _board_centroid(pixel: Array, darkness: Array, board_map: BoardMap) -> Array:
    """Return the pixel of the centroid on the board, each pixel weighted by the area of the board that it shows."""
    place = board_map.to_board(pixel)
    step = 0.5
    across, down = step * np.eye(2)
    by_x = (board_map.to_board(pixel + across) - board_map.to_board(pixel - across)) / (2 * step)
    by_y = (board_map.to_board(pixel + down) - board_map.to_board(pixel - down)) / (2 * step)
    weight = darkness * np.abs(by_x[:, 0] * by_y[:, 1] - by_x[:, 1] * by_y[:, 0])
    on_board = weight @ place / weight.sum()
    centroid = darkness @ pixel / darkness.sum()
    step_px = np.linalg.solve(board_map.derivative(centroid), on_board - board_map.to_board(centroid[None])[0])
    return np.asarray(centroid + step_px)


@dataclass(frozen=True, slots=True)
class DotEdges:
    """The edges of the dots in a photograph."""

    board_map: BoardMap
    diameter_px: float
    blur_px: float
    """Standard deviation of the blur of the photograph together with a smoothing of `SMOOTHING_PX`."""

    def distance_px(self, pixel: Array) -> Array:
        """Return the distance of pixels, shape (n, 2), of one neighbourhood from the nearest edge; negative within a dot."""
        board = self.board_map.to_board(pixel)
        scale_px = 1 / np.sqrt(abs(np.linalg.det(self.board_map.derivative(pixel.mean(axis=0)))))
        return np.asarray(np.hypot(*(board - np.rint(board)).T) * scale_px - self.diameter_px / 2)


def find_edges(light: NDArray[np.float32], dots_px: Array, diameter_px: float, board_map: BoardMap) -> DotEdges:
    """Measure the blur of the dots' edges: the area from 10 to 90 % of their darkness is the edge's width times its length."""
    reach = int(diameter_px * 0.75)
    smooth = cv2.GaussianBlur(light, (0, 0), SMOOTHING_PX)
    widths = []
    for x, y in np.rint(dots_px).astype(int).tolist():
        window = smooth[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1]
        black, white = np.quantile(window, [0.05, 0.95])
        darkness = (white - window) / (white - black)
        widths.append(((darkness > 0.1) & (darkness < 0.9)).sum() / (np.pi * diameter_px))
    sigma_px = float(np.median(widths)) / SIGMAS_10_TO_90
    return DotEdges(board_map, diameter_px, sigma_px)


def index_lattice(candidates: DotCandidates) -> tuple[Index, Index]:
    """Return the numbers of the dots on the lattice, shape (n,), and their columns and rows from 0, shape (n, 2).

    Columns run to the right and rows down in the photograph, as nearly as they can. Both are empty if there is no lattice.
    """
    places = candidates.centre_px
    best: dict[int, tuple[int, int]] = {}
    if len(places) >= MIN_DOTS:
        order = np.argsort(np.hypot(*(places - np.median(places, axis=0)).T))
        for seed in order[:SEED_DOTS].tolist():
            grown = _grow(places, seed)
            if len(grown) > len(best):
                best = grown
    if len(best) < MIN_DOTS:
        return np.empty(0, dtype=np.int64), np.empty((0, 2), dtype=np.int64)
    numbers, index = _complete(places, best)
    return numbers, _upright(places[numbers], index)


def _grow(places: Array, seed: int) -> dict[int, tuple[int, int]]:
    """Return the column and row of every dot that steps from neighbour to neighbour reach from a seed."""
    steps = _directions(places, seed)
    if steps is None:
        return {}
    found, taken = {seed: (0, 0)}, {(0, 0)}
    queue: deque[tuple[int, Array]] = deque([(seed, steps)])
    while queue:
        dot, (right, down) = queue.popleft()
        column, row = found[dot]
        for along, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
            node = (column + sign, row) if along == 0 else (column, row + sign)
            step = sign * (right, down)[along]
            away = np.hypot(*(places - places[dot] - step).T)
            neighbour = int(np.argmin(away))
            if node in taken or neighbour in found or away[neighbour] > NEIGHBOUR_SHARE * np.hypot(*step):
                continue
            found[neighbour] = node
            taken.add(node)
            seen = sign * (places[neighbour] - places[dot])
            queue.append((neighbour, np.array([seen, down] if along == 0 else [right, seen])))
    return found


def _directions(places: Array, seed: int) -> Array | None:
    """Return the steps to the nearest neighbour and to the nearest one across it, shape (2, 2)."""
    away = places - places[seed]
    order = np.argsort(np.hypot(*away.T))[1:9]
    first = away[order[0]]
    for number in order[1:]:
        second = away[number]
        lengths = np.hypot(*first), np.hypot(*second)
        if abs(first @ second) < MAX_DIRECTION_COSINE * lengths[0] * lengths[1] and lengths[1] < 2 * lengths[0]:
            return np.array([first, second])
    return None


def _complete(places: Array, found: dict[int, tuple[int, int]]) -> tuple[Index, Index]:
    """Return the dots that lie on the nodes of the perspective lattice through those found, with their nodes."""
    numbers, nodes = np.array(list(found)), np.array(list(found.values()))
    for _ in range(2):
        perspective = find_perspective(places[numbers], nodes.astype(np.float64), cv2.RANSAC, NODE_SHARE)
        if perspective is None:
            break
        on_lattice = cv2.perspectiveTransform(places[:, None].astype(np.float64), perspective)[:, 0]
        nearest = np.rint(on_lattice)
        numbers = np.flatnonzero(np.hypot(*(on_lattice - nearest).T) < NODE_SHARE)
        nodes = nearest[numbers].astype(np.int64)
        _, first = np.unique(nodes, axis=0, return_index=True)
        numbers, nodes = numbers[first], nodes[first]
    return _largest_group(numbers.astype(np.int64), nodes.astype(np.int64))


def _largest_group(numbers: Index, nodes: Index) -> tuple[Index, Index]:
    """Return the dots without those that have no neighbour on the lattice, from dots of something else."""
    apart = np.abs(nodes[:, None] - nodes).sum(axis=2)
    kept = (apart == 1).any(axis=1)
    return numbers[kept], nodes[kept]


def _upright(places: Array, index: Index) -> Index:
    """Return the index turned so that columns run to the right and rows down, from 0."""
    directions = np.linalg.lstsq(
        np.column_stack([index - index.mean(axis=0), np.ones(len(index))]).astype(np.float64), places, rcond=None
    )[0][:2]
    if abs(directions[0, 0]) < abs(directions[1, 0]):
        index, directions = index[:, ::-1], directions[::-1]
    signs = np.where(np.array([directions[0, 0], directions[1, 1]]) < 0, -1, 1)
    index = index * signs
    return np.asarray(index - index.min(axis=0), dtype=np.int64)
