"""Finds the laser spot in a photograph, and its centre to a fraction of a pixel.

The channel that does not see the laser shows how the board reflects at every pixel. The laser's irradiance is what its own
channel has beyond that, relative to it: a dot under the spot, uneven light and the edge of the board then do not move the centre.
"""

from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.bench.laser.dots import SMOOTHING_PX, DotEdges
from gateway.bench.laser.least_squares import LeastSquaresFit, fit_least_squares, jacobian
from gateway.bench.laser.photograph import MIN_SATURATED_VALUE, Photograph, to_light, to_share
from gateway.calibration.record import NotDeterminedError
from gateway.numerics.array import Array

SMOOTHING_SHARE = 1 / 16
"""Width of the smoothing in which a spot is looked for, diameters of a dot. Basis: coloured fringes at the dots' edges vanish in
it."""
MIN_SIGNAL = 8.0
"""Least height of a spot, standard deviations of the smoothed photograph. Basis: a choice; chance does not reach it in a
photograph of 1e7 pixels."""
SECOND_SPOT = 0.3
"""Height of a second spot, relative to the first, from which the photograph is refused. Basis: a choice; reflections are weaker,
and of two equal ones none is right."""
APART_DOTS = 0.75
"""Parts of one spot, which a dot divides, are nearer to each other than this, diameters of a dot. Basis: a choice; a dot and its
blur are in between."""
MIN_VALUE = 25
"""Values of the board's channel below this show no reflection. Basis: a choice; a tenth of full scale, where the noise of the
camera hides the light."""
WIDTH_RATIO = 1.6
"""Standard deviation of a Gaussian relative to that of its part above a third of its height. Basis: 1.5 by integration, a little
more so that the window holds the spot."""
WINDOW_SIGMAS = 4.0
"""Half width of the window of the fit. Basis: a choice; beyond it a Gaussian has 3e-4 of its height."""
MAX_PIXELS = 40_000
"""Pixels of the fit; in a larger window every second, third, ... row and column counts. Basis: a choice; 200 x 200, a fit within
a second, and more tell nothing new."""
CLIPPED_PX = 5
"""Width of the square around a clipped pixel whose pixels are not used: the smoothing spreads it. Basis: five standard deviations
of the smoothing (1 px)."""
MIN_PIXELS = 60
"""Basis: a choice; several for each parameter of the fit."""
MAX_SHIFT_BLURS = 1.2
"""Largest displacement by an edge, standard deviations of the blur, of a pixel that is used. Basis: a choice; a pixel farther
from its place lies on the wrong side of an edge."""
SMOOTHED_NOISE = 3.5
"""Least factor on the standard uncertainty as of independent pixels: the smoothing spreads each one's noise. Definition: the root
of the pixels that a smoothing of one pixel averages, 4 pi."""
BLOCK_PX = 16
"""Side of the blocks of pixels whose residuals count as independent. Definition: JPEG codes colour, of half the resolution, by
blocks of 8 x 8 from the corner of the photograph; speckle is finer."""
WHITE_QUANTILE, MIN_WHITE = 0.8, 80
"""Value that the white of the board must reach. Basis: a choice; paper covers most of the board, and a third of full scale shows
a dot."""
FLOOR_PX = 0.03
"""Standard uncertainty of a centre that no fit shows, px. Basis: centres in 60 rendered photographs, not compressed, scatter by
0.024 px beyond what their residuals show (maximum likelihood)."""
VALUE_NOISE = 2 / 255
"""Standard deviation of a value, 0 to 1, against which the expectations below are weighed. Basis: a choice; two values, as of a
camera in daylight."""
DOT_AMPLITUDE_SIGMA, DOT_GAIN_SIGMA = 0.15, 0.1
"""Standard deviations of what a dot's amplitude and gain differ from those of white, as logarithms. Basis: a choice; black ink
differs by some tens of per cent from white in what it reflects."""
GLARE_SIGMAS, MAX_GLARE = 3.0, 0.03
"""Radius around a spot, its larger standard deviations, and the largest share of clipped pixels of the board in it. Basis: a
choice; what is seen of a spot is then nearly whole, and a dead pixel is no glare."""
MAX_AXIS_RATIO = 6.0
"""Largest ratio of the axes of a spot. Basis: a choice; a beam at 80 degrees to the board."""


@dataclass(frozen=True, slots=True)
class LaserSpot:
    """A spot in a photograph."""

    centre_px: Array
    """Shape (2,)."""
    covariance_px2: Array
    """Shape (2, 2)."""
    sigma_px: tuple[float, float]
    """Larger and smaller standard deviation of its Gaussian."""
    axis_rad: float
    """Direction of the larger one, from x towards y."""


def find_spot(
    photograph: Photograph, region: NDArray[np.bool_], edges: DotEdges, fringe_px: Array | None = None
) -> LaserSpot:
    """Return the one spot within `region`, shape (height, width), on a board with these dots.

    `fringe_px`, shape (2,), is by how much the laser's channel is displaced against that of the board, as found in a first pass.
    Raises `NotDeterminedError` for none or two spots, and for a photograph that is too dark.
    """
    laser, board = to_light(photograph.laser), to_light(photograph.board)
    if np.quantile(photograph.board[region], WHITE_QUANTILE) < MIN_WHITE:
        raise NotDeterminedError(
            f"{photograph.path}: the board is too dark; expose more, until its white is light grey"
        )
    if fringe_px is not None:
        board = _displaced(board, fringe_px)
    dot_px = edges.diameter_px
    usable = region & (photograph.board >= MIN_VALUE)
    gain = float(np.median(laser[usable] / board[usable]))
    excess = np.where(region, laser - gain * board, 0).astype(np.float32)
    smoothed = cv2.GaussianBlur(excess, (0, 0), max(1.0, SMOOTHING_SHARE * dot_px))
    sigma = 1.4826 * float(np.median(np.abs(smoothed[region] - np.median(smoothed[region]))))
    peak = float(smoothed[region].max())
    if peak < MIN_SIGNAL * max(sigma, 1e-4):
        raise NotDeterminedError(
            f"{photograph.path}: no {photograph.colour} laser spot on the board; point the laser at it, or name its --colour"
        )
    bright = (smoothed > max(SECOND_SPOT * peak, MIN_SIGNAL * sigma)).astype(np.uint8)
    first, extent = _one_spot(photograph, bright, excess, APART_DOTS * dot_px)
    spot = _fit_spot(photograph, laser, board, region, edges, gain, first, extent)
    _check_glare(photograph, spot)
    return spot


def _check_glare(photograph: Photograph, spot: LaserSpot) -> None:
    """Raise `NotDeterminedError` for a spot in glare: the channel that does not see the laser is clipped there."""
    height, width = photograph.board.shape
    y, x = np.ogrid[:height, :width]
    near = np.hypot(x - spot.centre_px[0], y - spot.centre_px[1]) < GLARE_SIGMAS * spot.sigma_px[0]
    if np.mean(photograph.board[near] >= MIN_SATURATED_VALUE) > MAX_GLARE:
        x_px, y_px = spot.centre_px
        raise NotDeterminedError(
            f"{photograph.path}: glare lies on the spot near pixel {x_px:.0f}, {y_px:.0f}; turn the lamp or the board, or "
            "expose less"
        )


def _one_spot(
    photograph: Photograph, bright: NDArray[np.uint8], excess: NDArray[np.float32], apart_px: float
) -> tuple[Array, float]:
    """Return centre and standard deviation of the bright regions, in px, which must be parts of one spot."""
    count, labels = cv2.connectedComponents(bright)
    moments = []
    for label in range(1, count):
        y, x = np.nonzero(labels == label)
        weight = np.maximum(excess[y, x], 1e-6).astype(np.float64)
        moments.append((float(weight.sum()), float(weight @ x / weight.sum()), float(weight @ y / weight.sum())))
    moments.sort(reverse=True)
    centre = np.array(moments[0][1:])
    for _, *second in moments[1:]:
        if np.hypot(*(np.array(second) - centre)) > apart_px:
            places = " and ".join(f"{x:.0f}, {y:.0f}" for x, y in (centre, second))
            raise NotDeterminedError(
                f"{photograph.path}: two laser spots, at pixels {places}; cover the reflection or the second laser"
            )
    y, x = np.nonzero(bright)
    weight = np.maximum(excess[y, x], 1e-6).astype(np.float64)
    centre = np.array([weight @ x, weight @ y]) / weight.sum()
    spread = weight @ ((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / weight.sum() / 2
    return centre, WIDTH_RATIO * float(np.sqrt(max(spread, 1.0)))


def _fit_spot(
    photograph: Photograph,
    laser: NDArray[np.float32],
    board: NDArray[np.float32],
    region: NDArray[np.bool_],
    edges: DotEdges,
    gain: float,
    centre: Array,
    extent_px: float,
) -> LaserSpot:
    """Fit gain * board * (1 + Gaussian) to the laser's channel, in values of the photograph, where noise is uniform."""
    reach = int(np.ceil(WINDOW_SIGMAS * extent_px)) + 2
    height, width = laser.shape
    column, row = round(float(centre[0])), round(float(centre[1]))
    rows = slice(max(0, row - reach), min(height, row + reach + 1))
    columns = slice(max(0, column - reach), min(width, column + reach + 1))
    every = max(1, int(np.ceil(np.sqrt((rows.stop - rows.start) * (columns.stop - columns.start) / MAX_PIXELS))))
    window = (slice(rows.start, rows.stop, every), slice(columns.start, columns.stop, every))
    y, x = np.mgrid[window].astype(np.float64)
    clipped = (
        (photograph.laser >= MIN_SATURATED_VALUE)
        | (photograph.board >= MIN_SATURATED_VALUE)
        | (photograph.board < MIN_VALUE)
    )
    near_clipped = cv2.dilate(clipped.astype(np.uint8), np.ones((CLIPPED_PX, CLIPPED_PX)))
    usable = region[window] & (near_clipped[window] == 0)
    laser, board = _smoothed(laser), _smoothed(board)
    distance = edges.distance_px(np.column_stack([x.ravel(), y.ravel()])).reshape(usable.shape)
    shift = _edge_shift(board[window], edges.blur_px, every)
    usable &= np.hypot(*shift) < MAX_SHIFT_BLURS * edges.blur_px
    failure = NotDeterminedError(
        f"{photograph.path}: the laser spot near pixel {column}, {row} cannot be measured; dim the laser, or expose less"
    )
    if usable.sum() < MIN_PIXELS:
        raise failure
    pixels = _SpotPixels(
        place=np.column_stack([(x + shift[0])[usable], (y + shift[1])[usable]]) - centre,
        laser=to_share(laser[window][usable].astype(np.float64)),
        ratio=(laser[window][usable] / board[window][usable]).astype(np.float64),
        board=board[window][usable].astype(np.float64),
        on_dot=distance[usable] < 0,
    )
    found = _fit_gaussian(pixels, gain, extent_px)
    covariance = _pixel_covariance(pixels, *found, every, centre) if found else None
    if found is None or covariance is None:
        raise failure
    return _checked_spot(photograph, found[0].parameters, covariance, centre, reach)


def _displaced(light: NDArray[np.float32], by_px: Array) -> NDArray[np.float32]:
    height, width = light.shape
    matrix = np.column_stack([np.eye(2), by_px])
    moved = cv2.warpAffine(light, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(np.maximum(moved, 1e-4), dtype=np.float32)


def _smoothed(light: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(light, (0, 0), SMOOTHING_PX), dtype=np.float32)


def _edge_shift(board: NDArray[np.float32], blur_px: float, every: int) -> Array:
    """Return by how many pixels x and y, shape (2, height, width), the laser seen in a pixel is displaced by a blurred edge.

    Blur mixes light from the bright side into the dark one, so a pixel near an edge shows the laser of a place nearer to the
    bright side: by blur^2 times the gradient of the logarithm of what is reflected, for a Gaussian blur.
    """
    smooth = np.log(np.maximum(board, 1e-4)).astype(np.float64)
    down, across = np.gradient(smooth, every)
    return blur_px**2 * np.stack([across, down])


@dataclass(frozen=True, slots=True)
class _SpotPixels:
    """The pixels of a fit: place relative to the first guess (n, 2), value of the laser's channel, light of the board's."""

    place: Array
    laser: Array
    ratio: Array
    """Light of the laser's channel over that of the board's."""
    board: Array
    on_dot: NDArray[np.bool_]

    def light(self, parameters: Array) -> Array:
        """Return the light of the laser's channel.

        Parameters: log amplitude, centre (2), triangular root of the inverse covariance (3), log gain; and what amplitude and
        gain have more on dots, in logarithms, because flare and the photograph's tone curve do not scale with light.
        """
        log_amplitude, x, y, a, b, c, log_gain, more_amplitude, more_gain = parameters
        dx, dy = self.place[:, 0] - x, self.place[:, 1] - y
        square = (a * dx + b * dy) ** 2 + (c * dy) ** 2
        amplitude = np.exp(log_amplitude + more_amplitude * self.on_dot - square / 2)
        return np.asarray(np.exp(log_gain + more_gain * self.on_dot) * self.board * (1 + amplitude))

    def residual(self, weight: Array, parameters: Array) -> Array:
        """Return the weighted residuals of the values, and those of the dots' two parameters from 0."""
        prior = VALUE_NOISE * parameters[7:] / np.array([DOT_AMPLITUDE_SIGMA, DOT_GAIN_SIGMA])
        return np.concatenate([weight * (to_share(self.light(parameters)) - self.laser), prior])


def _fit_gaussian(pixels: _SpotPixels, gain: float, extent_px: float) -> tuple[LeastSquaresFit, Array] | None:
    """Fit in two passes; in the second, pixels are weighted by the noise of both channels."""
    amplitude = float(np.quantile(pixels.ratio / gain, 0.99)) - 1
    start = np.array([np.log(max(amplitude, 0.01)), 0.0, 0.0, 1 / extent_px, 0.0, 1 / extent_px, np.log(gain)])
    scale = np.array([1.0, extent_px, extent_px, 1 / extent_px, 1 / extent_px, 1 / extent_px, 1.0])
    start, scale = np.append(start, [0.0, 0.0]), np.append(scale, [1.0, 1.0])
    first = fit_least_squares(partial(pixels.residual, np.ones_like(pixels.laser)), start, scale)
    if first is None:
        return None
    weight = 1 / np.hypot(1, to_share(pixels.light(first.parameters)) / to_share(pixels.board))
    second = fit_least_squares(partial(pixels.residual, weight), first.parameters, scale)
    return None if second is None else (second, weight)


def _pixel_covariance(
    pixels: _SpotPixels, fit: LeastSquaresFit, weight: Array, every: int, centre: Array
) -> Array | None:
    """Return the covariance of the parameters, by a jackknife over blocks of pixels; None if a block alone determines them.

    Residuals are correlated within a block, and small because the fit follows each: how far it moves without the block shows
    what the block contributes (MacKinnon and White 1985, Bell and McCaffrey 2002). The few blocks of a spot show the size of the
    covariance but not its shape, which is that of independent noise; nor is it taken for less than that of smoothed noise.
    """
    scale = np.maximum(np.abs(fit.parameters), 1e-3)
    slope = jacobian(partial(pixels.residual, weight), fit.parameters, scale) * scale
    normal = slope.T @ slope
    column, row = np.floor((pixels.place + centre) / BLOCK_PX).astype(np.int64).T
    _, block = np.unique(column * 100_000 + row, return_inverse=True)
    blocks = int(block.max()) + 1
    moves = []
    for number in range(blocks):
        rows = np.flatnonzero(block == number)
        others = normal - slope[rows].T @ slope[rows]
        if np.linalg.matrix_rank(others, hermitian=True) < len(scale):
            return None
        moves.append(scale * np.linalg.solve(others, slope[rows].T @ fit.residual[rows]))
    by_blocks = (blocks - 1) / blocks * np.sum(np.square(moves), axis=0)
    independent = fit.covariance * (SMOOTHED_NOISE * every) ** 2
    share = max(1.0, float(by_blocks[1:3].sum() / np.trace(independent[1:3, 1:3])))
    return np.asarray(independent * share)


def _checked_spot(photograph: Photograph, parameters: Array, covariance: Array, centre: Array, reach: int) -> LaserSpot:
    """Return the spot of a fit. Raises `NotDeterminedError` if the fit shows something else."""
    root = np.array([[parameters[3], parameters[4]], [0.0, parameters[5]]])
    values, vectors = np.linalg.eigh(root.T @ root)
    sigma = 1 / np.sqrt(np.maximum(values, 1e-12))
    if np.hypot(*parameters[1:3]) > reach or sigma[0] > MAX_AXIS_RATIO * sigma[1] or sigma[0] > 2 * reach:
        raise NotDeterminedError(
            f"{photograph.path}: what is bright near pixel {centre[0]:.0f}, {centre[1]:.0f} is no round laser spot"
        )
    return LaserSpot(
        centre_px=centre + parameters[1:3],
        covariance_px2=covariance[1:3, 1:3] + FLOOR_PX**2 * np.eye(2),
        sigma_px=(float(sigma[0]), float(sigma[1])),
        axis_rad=float(np.arctan2(vectors[1, 0], vectors[0, 0])),
    )
