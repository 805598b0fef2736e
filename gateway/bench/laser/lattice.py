"""Gives the dots of a photograph their column and row, with some of them hidden, and whichever way the board is turned."""

from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.bench.laser.board import find_perspective
from gateway.bench.laser.dots import DotCandidates
from gateway.numerics.array import Array

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
