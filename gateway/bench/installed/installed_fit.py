"""What free swings and rests of many days say of sensor, mount and place, with the scatter from day to day as the uncertainty.

With u the horizontal part of the direction of a rope that does not twist, and rho the place of the housing over its length, a
free rope reads

    across  K^-1 (1 - rho) u            along  sqrt(1 - u^2) + rho (u'^2 + (u . u')^2/(1 - u^2))/w0^2 + line . across + level

so the axial force against the square of the transverse one gives K (1 - rho), and its slow part against its line at twice the
frequency rho. Its line at the frequency itself is mount - lean/(1 - rho) - (place beside the rope)/((1 - rho) L); the means
across are zero-g offset - mount + lean. No wind moves the sum of the means and (1 - rho) times the line.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.bench.installed.free_motion import FreeWindow
from gateway.numerics.array import Array
from gateway.numerics.stats import student_quantile
from gateway.swing.rig import MountedHousing

POINTS = 96
"""Times at which a window is compared. Basis: 16 in a period show four harmonics."""
DAY_S, SLOT_S = 86_400.0, 600.0
"""A day, whose lean is drawn anew, and a time in which the level along the rope changes in a straight line. Basis: weather; a
housing warms by 0.1 °C in ten minutes, its rate by less than a fifth of that."""
SCALE_PRIOR, PLACE_PRIOR_REL = 0.1, 0.2
"""Standard deviation before the data of a scale factor's error, and of the place over the rope's length. Basis: wider than any
part or tape measure; what the data do not show stays near zero, and is recognised by it."""
DETERMINED = 0.3
"""Share of that deviation below which a parameter is determined by the data, and of the strongest direction of swings that the
weakest needs. Basis: a choice; the prior then has less than a tenth of the weight."""
MIN_DAYS = 5
"""Least number of days. Basis: a choice; of fewer the scatter is not known to a half."""
ITERATIONS = 4
"""Basis: an error of the place by a tenth of the rope's length has converged to a thousandth of the interval."""
PLACE, SCALE_X, SHEAR, SCALE_Y = range(4)
"""Definition: order of the parameters of a swing; the scale factors are relative to the root of that along the rope."""
MOVING = ("place_m", "scale_x", "scale_y", "scale_y_over_x")
RESTING = ("along_g", "across_x_g", "across_y_g")
LINES = (
    "windless_x_g", "windless_y_g", "mount_about_x_rad", "mount_about_y_rad", "offset_x_g", "offset_y_g",
)  # fmt: skip
"""Definition: names of the estimates from the shape of swings, from means, and from the axial line of swings."""


@dataclass(frozen=True, slots=True)
class InstalledEstimate:
    """A parameter as it differs from what is stated, with its 95 % interval by the scatter from day to day."""

    value: float
    half: float
    """Half of the interval."""
    days: int


@dataclass(frozen=True, slots=True)
class InstalledFit:
    """The estimates by name, without those that the data do not determine."""

    estimates: dict[str, InstalledEstimate]
    length_m: Array
    """Length of the rope by the period of each swing."""
    lever: float
    """Mean 1 - rho of the swings."""
    rests: int


def fit_installed(windows: Sequence[FreeWindow], housing: MountedHousing) -> InstalledFit:
    """Return what windows in order of time say of a housing that is believed to be placed so. Some must be swings."""
    swings = _Swings(windows, housing)
    theta = np.zeros(4)
    for _ in range(ITERATIONS):
        days = swings.by_day(theta)
        theta = theta + days.step(np.ones(len(days.windows)))
    days = swings.by_day(theta)
    lever, length_m = swings.levers(theta[PLACE])
    moving = swings.is_swing > 0
    return InstalledFit(days.estimates(), length_m[moving], float(lever[moving].mean()), int((~moving).sum()))


@dataclass(frozen=True, slots=True)
class _Days:
    """Sums over the windows of each day, shape (days, ...), linearised at the parameters `theta`, (4,)."""

    theta: Array
    prior: Array
    """1/variance of the parameters, in units of 1/variance of a point."""
    windows: Array
    information: Array
    gradient: Array
    level_g: Array
    level_by: Array
    """Sum of the levels' derivatives by the parameters."""
    across_g: Array
    direction: Array
    """Mean over the swings of a day, zero without one: dyadics of their directions, (days, 2, 2)."""
    line: Array
    """Mean of the axial force per transverse one along the direction, (days, 2)."""
    windless_g: Array

    def step(self, use: Array) -> Array:
        """Return the step of the parameters by the days in use, which have the weight 1."""
        matrix = np.einsum("d,dij->ij", use, self.information) + np.diag(self.prior)
        return np.asarray(np.linalg.solve(matrix, use @ self.gradient - self.prior * self.theta))

    def values(self, use: Array) -> Array:
        """Return the parameters in the order of their names."""
        step = self.step(use)
        place, x, _, y = self.theta + step
        means = use @ np.column_stack([self.level_g - self.level_by @ step, self.across_g]) / (use @ self.windows)
        direction = np.einsum("d,dij->ij", use, self.direction) + 1e-9 * np.eye(2)
        line, windless = np.linalg.solve(direction, (use @ np.hstack([self.line, self.windless_g])).reshape(2, 2).T).T
        return np.array([place, x, y, y - x, *means, *windless, line[1], -line[0], *(means[1:] + line)])

    def estimates(self) -> dict[str, InstalledEstimate]:
        """Return the determined parameters, with the jackknife's variance over the days (Efron 1982).

        Its degrees of freedom follow from the share of each day in the variance (GUM G.4.1).
        """
        every = np.ones(len(self.windows))
        values = self.values(every)
        left_out = np.array([self.values(every - one) for one in np.eye(len(every))])
        swinging = (self.direction != 0).any(axis=(1, 2)).astype(float)
        place, x, _, y = np.linalg.inv(self.information.sum(axis=0) + np.diag(self.prior))
        columns = [np.einsum("i,dij,j->d", row, self.information, row) for row in (place, x, y, y - x)]
        found = {}
        names = [*MOVING, *RESTING, *LINES]
        for name, value, others, share in zip(
            names, values, left_out.T, [*columns, *[every] * 3, *[swinging] * 6], strict=True
        ):
            used = share > 0
            days = int(used.sum())
            effective = share.sum() ** 2 / max(
                float((share**2).sum()), 1e-300
            )  # a few wide swings may outweigh the rest
            if self._determines(name) and effective > MIN_DAYS - 1:
                u = np.sqrt((days - 1) * others[used].var())
                found[name] = InstalledEstimate(float(value), student_quantile(0.975, effective - 1) * float(u), days)
        return found

    def _determines(self, name: str) -> bool:
        total = self.information.sum(axis=0) + np.diag(self.prior)
        known = np.diag(np.linalg.inv(total)) * self.prior < DETERMINED**2
        towards = np.linalg.eigvalsh(self.direction.sum(axis=0))
        needs = dict(zip(MOVING, ([PLACE], [SCALE_X], [SCALE_Y], [SCALE_X, SCALE_Y]), strict=True))
        return bool(known[needs.get(name, [])].all()) and (name not in LINES or towards[0] > DETERMINED**2 * towards[1])


class _Swings:
    """The windows as arrays, (w, ...)."""

    def __init__(self, windows: Sequence[FreeWindow], housing: MountedHousing) -> None:
        def column(name: str) -> Array:
            return np.array([getattr(each, name) for each in windows])

        self._housing = housing
        self._middle_s, self._rate, half_s = column("middle_s"), column("rate_1_s"), column("half_s")
        self.is_swing = column("is_swing").astype(np.float64)
        self._day, self._slot = (
            np.unique(self._middle_s // span_s, return_inverse=True)[1] for span_s in (DAY_S, SLOT_S)
        )
        self._variance = float(np.mean(column("noise_g") ** 2)) * POINTS
        mean, waves, spread_s2 = column("mean_g"), column("waves_g"), column("spread_s2")
        self._blur = 2 * spread_s2 * self._rate**2
        self._mean_across = mean[:, 0, :2] + mean[:, 2, :2] / 3
        self._first = waves[:, 0, 0]
        place = (np.arange(POINTS) + 0.5) * 2 / POINTS - 1
        turn = np.exp(1j * np.outer(self._rate * half_s, place))[..., None]
        powers, slopes = place[:, None] ** np.arange(3), np.column_stack([0 * place, 1 + 0 * place, 2 * place])
        one, three = waves[:, 0, :, :2], waves[:, 2, :1, :2] * (1 + 4.5 * spread_s2 * self._rate**2)[:, None, None]
        self._decay = -(one[:, 0].conj() * one[:, 1]).real.sum(axis=1) / np.maximum(self._size, 1e-30)
        self._decay /= self._rate * half_s
        one = one * (1 + spread_s2 * self._rate**2 / 2)[:, None, None]
        first = np.einsum("pk,wka->wpa", powers, one)
        rate = np.einsum("pk,wka->wpa", slopes, one) / (self._rate * half_s)[:, None, None]
        self._across = np.stack([first * turn, (rate + 1j * first) * turn])
        self._third = np.stack([three * turn**3, 3j * three * turn**3]).real
        even = (np.einsum("pk,wk->wp", powers, waves[:, 1, :, 2]) * turn[..., 0] ** 2).real
        self._axial = mean[..., 2] @ powers.T + even + (waves[:, 3, :1, 2] * turn[..., 0] ** 4).real

    @property
    def _size(self) -> Array:
        """Square of the transverse amplitude, (w,)."""
        return np.asarray((np.abs(self._first[:, :2]) ** 2).sum(axis=1))

    def levers(self, place_m: float) -> tuple[Array, Array]:
        """Return 1 - rho and the rope's length by the period, (w,) each, for a housing farther from its reference by so much."""
        housing, length_m = self._housing, np.full(len(self._rate), self._housing.length_m)
        for _ in range(4):
            if housing.above_load_m is None:
                lever = 1 - (float(housing.position_m or 0.0) + place_m) / length_m
            else:
                lever = (housing.above_load_m + place_m) / length_m
            lever = np.clip(lever, 0.01, 1.0)
            length_m = housing.gravity_m_s2 * (self._rate_ratio(lever) / self._rate) ** 2
        return lever, length_m

    def _rate_ratio(self, lever: Array) -> Array:
        """Return the frequency over that of a small swing, (w,): an ellipse turns as it swings."""
        area = (self._first[:, 0] * self._first[:, 1].conj()).imag / lever**2
        square = np.maximum(self._size / lever**2, 1e-30)
        return np.asarray(1 - square / 16 + 0.75 * area**2 / square)

    def _lag(self, place_m: float) -> NDArray[np.complex128]:
        """Return the factor that takes the drag's part off the transverse readings, (w, 1, 1); it says nothing of the place."""
        lever, _ = self.levers(place_m)
        return np.asarray(1 / (1 - 2j * self._decay * (1 - lever) / lever))[:, None, None]

    def _predicted(self, theta: Array, lag: NDArray[np.complex128]) -> Array:
        """Return the axial force without line and level, (w, p)."""
        lever, _ = self.levers(theta[PLACE])
        matrix = np.eye(2) - np.array([[theta[SCALE_X], theta[SHEAR]], [theta[SHEAR], theta[SCALE_Y]]])
        u, rate = ((lag * self._across).real + self._third) @ matrix / lever[:, None, None]
        square = (u**2).sum(axis=2)
        # the housing's axes are the world's, turned by the least rotation to the rope: u is the horizontal part of its direction
        speed = (rate**2).sum(axis=2) + (u * rate).sum(axis=2) ** 2 / (1 - square)
        force = np.sqrt(1 - square) + ((1 - lever) * self._rate_ratio(lever) ** 2)[:, None] * speed
        mean = force.mean(axis=1)[:, None]
        return np.asarray(mean + (force - mean) * (1 - self._blur)[:, None])

    def by_day(self, theta: Array) -> _Days:
        """Return the sums of each day at these parameters."""
        steps = np.diag([1e-4 * self._housing.length_m, 1e-4, 1e-4, 1e-4])
        lag = self._lag(theta[PLACE])
        force = self._predicted(theta, lag)
        design = np.stack([(self._predicted(theta + step, lag) - force) / step.sum() for step in steps], axis=2)
        residual = self._axial - force
        level, level_by = residual.mean(axis=1), design.mean(axis=1)
        residual = residual - self._slot_line(level)[:, None]
        design = design - np.stack([self._slot_line(column) for column in level_by.T], axis=1)[:, None]
        swings = np.maximum(self._by_day(self.is_swing), 1.0)[:, None]
        size = np.where(self.is_swing > 0, np.maximum(self._size, 1e-30), np.inf)[:, None]
        across, along = self._first[:, :2], self._first[:, 2:]
        direction = (across[:, :, None] * across[:, None].conj()).real / size[..., None]
        line = (across.conj() * along).real / size
        lean_g = self._mean_across - self._mean_across.mean(axis=0)
        windless = np.einsum("wij,wj->wi", direction, self._mean_across) + self.levers(theta[PLACE])[0][:, None] * line
        return _Days(
            theta=theta,
            prior=self._variance / np.square([PLACE_PRIOR_REL * self._housing.length_m, *[SCALE_PRIOR] * 3]),
            windows=self._by_day(np.ones(len(level))),
            information=self._by_day(np.einsum("wpi,wpj->wij", design, design)),
            gradient=self._by_day(np.einsum("wpi,wp->wi", design, residual)),
            level_g=self._by_day(level + (lean_g**2).sum(axis=1) / 2),  # a leaning rope reads its cosine along it
            level_by=self._by_day(level_by),
            across_g=self._by_day(self._mean_across),
            direction=self._by_day(direction) / swings[..., None],
            line=self._by_day(line) / swings,
            windless_g=self._by_day(windless) / swings,
        )

    def _by_day(self, values: Array) -> Array:
        sums = np.zeros((int(self._day.max()) + 1, *values.shape[1:]))
        np.add.at(sums, self._day, values)
        return sums

    def _slot_line(self, values: Array) -> Array:
        """Return the straight lines in time through the values (w,) of each slot: the level along the rope warms and cools."""
        count = np.bincount(self._slot)
        at_s = self._middle_s - (np.bincount(self._slot, self._middle_s) / count)[self._slot]
        slope = np.bincount(self._slot, at_s * values) / np.maximum(np.bincount(self._slot, at_s**2), 1e-9)
        return np.asarray((np.bincount(self._slot, values) / count)[self._slot] + at_s * slope[self._slot])
