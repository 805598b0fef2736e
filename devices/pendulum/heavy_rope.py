"""A load on a heavy rope: its swing, and the first mode of the rope as a string.

The rope's point at the fraction x of its length L is at x L n + sin(pi x) w, with w at right angles to n (Galerkin's method with
two shapes, Inman 2014, section 8.2). Masses are over the load's, mu is that of the rope; a_t is the part of a vector a at right
angles to n, and g' = g - a_p:

    (1 + mu/3) L n''_t + (mu/pi) w''_t = (1 + mu/2) (g'_t - 2 L' n') + F_t/m - (2 mu/pi) (n.g')/L w
    (mu/pi) L n''_t + (mu/2) w''_t     = (mu/pi) (2 g'_t - 2 L' n') - pi^2/(2 L) (T/m + mu n.g'/2) w - c w'_t

with the tension T/m = n.g' + n.F/m + L |n'|^2 at the load. The rope sags by mu L (x/3 - x^2/2 + x^3/6) g'_t m/T in a slow swing;
what sin(pi x) lacks of this shape follows the swing.
"""

from dataclasses import dataclass
from math import pi

from devices.pendulum.equations import Scalar, Vector, add, cross, dot, scale


@dataclass(frozen=True, slots=True)
class HeavyRope:
    """A rope with mass, and the load on it."""

    length: Scalar
    """m."""
    length_rate: Scalar
    """m/s."""
    mass_ratio: Scalar
    """Mass of the rope over that of the load."""
    damping_ratio: Scalar
    """Of the string mode."""
    gravity: Scalar
    """m/s^2."""
    gyration_squared: Scalar = 0.0
    """Of the load, m^2."""

    @property
    def string_rate(self) -> Scalar:
        """Angular frequency of the string mode beside a load at rest, rad/s."""
        mu = self.mass_ratio
        squared: Scalar = pi**2 / 2 * (1 + mu / 2) * self.gravity / (self.length * mu * self._string_inertia)
        return squared**0.5

    @property
    def _string_inertia(self) -> Scalar:
        """Inertia of the string mode over mu: what is left of 1/2 as the load gives way."""
        return 1 / 2 - self.mass_ratio / pi**2 / self._swing_inertia

    @property
    def _swing_inertia(self) -> Scalar:
        """Over m L^2."""
        return 1 + self.mass_ratio / 3 + self.gyration_squared / self.length**2

    def accelerations(
        self, n: Vector, n_rate: Vector, bow: Vector, bow_rate: Vector, drive: Vector, force: Vector
    ) -> tuple[Vector, Vector]:
        """n'' in 1/s^2 and w''_t in m/s^2; `bow` is w in m, `bow_rate` is w'_t.

        `drive` is g' on rope and load, `force` is F/m on the load, both in m/s^2.
        """
        mu, weight = self.mass_ratio, dot(n, drive)
        tension = weight + dot(n, force) + self.length * dot(n_rate, n_rate)
        stiffness = pi**2 / (2 * mu * self.length) * (tension + mu * weight / 2)
        damping = 2 * self.damping_ratio * self.string_rate * self._string_inertia
        pull, coriolis = across(n, drive), scale(-2 * self.length_rate, n_rate)
        swing = add(scale(1 + mu / 2, add(pull, coriolis)), across(n, force))
        swing = add(swing, scale(-2 * mu / pi * weight / self.length, bow))
        string = add(scale(2 / pi, pull), scale(1 / pi, coriolis))
        string = add(string, add(scale(-stiffness, bow), scale(-damping, bow_rate)))
        string = add(string, scale(-1 / (pi * self._swing_inertia), swing))
        bow_acceleration = scale(1 / self._string_inertia, string)
        swing = add(swing, scale(-mu / pi, bow_acceleration))
        n_acceleration = scale(1 / (self.length * self._swing_inertia), swing)
        return add(n_acceleration, scale(-dot(n_rate, n_rate), n)), bow_acceleration


@dataclass(frozen=True, slots=True)
class BentRope:
    """A heavy rope in motion."""

    rope: HeavyRope
    n: Vector
    n_rate: Vector
    n_acceleration: Vector
    bow: Vector
    bow_rate: Vector
    bow_acceleration: Vector
    drive: Vector
    """g - a_p, m/s^2."""

    def slope(self, fraction: Scalar, cos: Scalar) -> Vector:
        """Change of the rope's direction beside n at the fraction x of its length; `cos` is cos(pi x)."""
        by_bow = scale(pi / self.rope.length * cos, self.bow)
        share = self.rope.mass_ratio * _slope_beyond_bow(fraction, cos) / self._tension
        return add(by_bow, scale(share, across(self.n, self.drive)))

    def turning(self, fraction: Scalar, cos: Scalar) -> Scalar:
        """Angular velocity about n, in rad/s, of a housing that does not turn about the rope where it is.

        Beside axes that are carried along the line to the load and tilted by the slope s: n.(s x n') + n.(s x s')/2, the
        difference of the areas that the two directions sweep.
        """
        slope = self.slope(fraction, cos)
        by_bow = scale(pi / self.rope.length * cos, self.bow_rate)
        by_pull = scale(-self.rope.mass_ratio * _slope_beyond_bow(fraction, cos), self.n_rate)
        slope_rate = add(by_bow, by_pull)
        return dot(self.n, cross(slope, add(self.n_rate, scale(0.5, slope_rate))))

    def acceleration(self, fraction: Scalar, sin: Scalar) -> Vector:
        """Acceleration of the rope's point beside that on the straight line to the load, m/s^2; `sin` is sin(pi x)."""
        n, n_rate, drive = self.n, self.n_rate, self.drive
        along = 2 * dot(self.bow_rate, n_rate) + dot(self.bow, self.n_acceleration)
        of_bow = add(self.bow_acceleration, scale(-along, n))
        of_bow = add(of_bow, scale(-dot(self.bow, n_rate), n_rate))
        of_pull = add(scale(dot(n, drive), self.n_acceleration), scale(2 * dot(n_rate, drive), n_rate))
        of_pull = add(of_pull, scale(dot(self.n_acceleration, drive), n))
        remainder = fraction / 3 - fraction**2 / 2 + fraction**3 / 6 - 2 / pi**3 * sin
        sag = self.rope.mass_ratio * self.rope.length * remainder / self._tension
        return add(scale(sin, of_bow), scale(-sag, of_pull))

    @property
    def _tension(self) -> Scalar:
        return dot(self.n, self.drive) + self.rope.length * dot(self.n_rate, self.n_rate)


def _slope_beyond_bow(fraction: Scalar, cos: Scalar) -> Scalar:
    """The slope of the sag in a slow swing that the first string mode lacks, over mu and the pull across over the tension."""
    return 1 / 3 - fraction + fraction**2 / 2 - 2 / pi**2 * cos


def across(n: Vector, a: Vector) -> Vector:
    """The part of a vector at right angles to n."""
    return add(a, scale(-dot(n, a), n))
