"""The one statement of the equations of motion of a load on a rope, free of singularities, component by component.

A vector is a triple and a component whatever can be added and multiplied: a float, a numpy array with an entry for each
instant, a symbol. The simulated crane evaluates these functions with numbers; the twin builds its compiled model of them.

World frame: z up. n is the unit vector from the pivot to the load, L(t) the rope's length, r(t) the accelerometer's distance
from the pivot. The housing's z axis is -n; it does not turn about the rope, so its x axis is carried along by parallel
transport. Derived from Newton's law for point loads on massless ropes:

    n'' = (I - n n^T) d/L - 2 (L'/L) n' - |n'|^2 n            with the drive d = g - a_p + F/m
    f   = a_p + r n'' + 2 r' n' + r'' n - g                    specific force at the housing

with a_p the pivot's acceleration and F all other forces on the load. A hook block of mass M between rope and rigging makes
two pendulums of it, coupled by the tension of the rigging (`tensions_of_two`).
"""

from typing import Any, TypeAlias

Scalar: TypeAlias = Any
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
WithDerivatives: TypeAlias = tuple[Scalar, Scalar, Scalar]
"""A quantity with its first and second derivative by time."""


def dot(a: Vector, b: Vector) -> Scalar:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def add(a: Vector, b: Vector) -> Vector:
    """Sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def scale(factor: Scalar, a: Vector) -> Vector:
    """A vector, scaled."""
    return factor * a[0], factor * a[1], factor * a[2]


def horizontal_product(symmetric: Vector, a: Vector) -> Vector:
    """A horizontal symmetric tensor (xx, xy, yy) times a vector."""
    return symmetric[0] * a[0] + symmetric[1] * a[1], symmetric[1] * a[0] + symmetric[2] * a[1], 0.0


def acceleration_of_direction(n: Vector, n_rate: Vector, drive: Vector, length: Scalar, length_rate: Scalar) -> Vector:
    """n'' in 1/s^2 of a rope whose load is driven by `drive` in m/s^2; lengths in m and m/s."""
    along, turning = dot(n, drive), dot(n_rate, n_rate)
    x, y, z = (
        (d - along * c - 2 * length_rate * c_rate) / length - turning * c
        for c, c_rate, d in zip(n, n_rate, drive, strict=True)
    )
    return x, y, z


def acceleration_on_yielding_pivot(
    n: Vector,
    n_rate: Vector,
    drive: Vector,
    length: Scalar,
    length_rate: Scalar,
    gyration_squared: Scalar,
    compliance: Vector,
    gravity: Scalar,
) -> Vector:
    """n'' in 1/s^2 where the pivot stands at C n_h without mass of its own; C = (xx, xy, yy) in m, n_h horizontal.

    Lagrange's equation of a load at B n, B = L I + C, on a spring that gives way by C n_h under the weight's pull along n:
    (B^2 + k^2) n'' = B (d - 2 L' n') - g C n_h + lambda n, with lambda such that n stays a unit vector.
    """
    (xx, xy, yy), turning = compliance, dot(n_rate, n_rate)
    b_xx, b_yy = length + xx, length + yy
    x, y, z = (d - 2 * length_rate * rate for d, rate in zip(drive, n_rate, strict=True))
    shift = horizontal_product(compliance, n)
    pull = (
        b_xx * x + xy * y - gravity * shift[0],
        xy * x + b_yy * y - gravity * shift[1],
        length * z,
    )
    m_xx, m_xy, m_yy = b_xx**2 + xy**2 + gyration_squared, xy * (b_xx + b_yy), b_yy**2 + xy**2 + gyration_squared
    determinant, m_zz = m_xx * m_yy - m_xy**2, length**2 + gyration_squared

    def over_inertia(a: Vector) -> Vector:
        return (m_yy * a[0] - m_xy * a[1]) / determinant, (m_xx * a[1] - m_xy * a[0]) / determinant, a[2] / m_zz

    free, along = over_inertia(pull), over_inertia(n)
    return add(free, scale(-(turning + dot(n, free)) / dot(n, along), along))


def transport_rate(n: Vector, n_rate: Vector, x_axis: Vector) -> Vector:
    """x' in 1/s of an axis at right angles to the rope that has no angular velocity along it."""
    return scale(-dot(x_axis, n_rate), n)


def lever_arm_acceleration(
    n: Vector,
    n_rate: Vector,
    n_acceleration: Vector,
    x_axis: Vector,
    along_x: WithDerivatives,
    along_y: WithDerivatives,
) -> Vector:
    """d'' in m/s^2 of a lever arm d across the rope with components (m, m/s, m/s^2) along x_axis and (-n) x x_axis.

    Of an axis e that is carried along by parallel transport, e' = -(n'.e) n and e'' = -(n''.e) n - (n'.e) n'.
    """
    total: Vector = (0.0, 0.0, 0.0)
    for axis, (place, rate, acceleration) in (
        (x_axis, along_x),
        (cross(scale(-1, n), x_axis), along_y),
    ):
        turning = dot(axis, n_rate)
        along_rope = -place * dot(axis, n_acceleration) - 2 * rate * turning
        carried = add(scale(along_rope, n), scale(-place * turning, n_rate))
        total = add(total, add(carried, scale(acceleration, axis)))
    return total


def specific_force(
    n: Vector,
    n_rate: Vector,
    n_acceleration: Vector,
    pivot_acceleration: Vector,
    gravity: Scalar,
    position: Scalar,
    position_rate: Scalar,
    position_acceleration: Scalar,
) -> Vector:
    """What an accelerometer on the rope feels, in the world's axes, in m/s^2; positions in m and their derivatives."""
    x, y, z = (
        pivot + position * acceleration + 2 * position_rate * rate + position_acceleration * c
        for pivot, acceleration, rate, c in zip(pivot_acceleration, n_acceleration, n_rate, n, strict=True)
    )
    return x, y, z + gravity


def in_housing(n: Vector, x_axis: Vector, vector: Vector) -> Vector:
    """Components of a world's vector along the housing's x, y and z axes."""
    z_axis = scale(-1, n)
    return dot(x_axis, vector), dot(cross(z_axis, x_axis), vector), dot(z_axis, vector)


def direction(sin_x: Scalar, cos_x: Scalar, sin_y: Scalar, cos_y: Scalar) -> Vector:
    """n of a rope that leans by angles x toward world x and y toward world y, given by their sines and cosines."""
    return sin_x * cos_y, sin_y, -cos_x * cos_y


def direction_by_tilts(sin_x: Scalar, cos_x: Scalar, sin_y: Scalar, cos_y: Scalar) -> tuple[Vector, Vector]:
    """Derivatives of `direction` by its two angles; they are at right angles, of lengths cos(y) and 1."""
    return (cos_x * cos_y, 0.0 * cos_y, sin_x * cos_y), (-sin_x * sin_y, cos_y, cos_x * sin_y)


def tensions_of_two(
    n: Vector,
    n_rate: Vector,
    m: Vector,
    m_rate: Vector,
    hook_drive: Vector,
    load_drive: Vector,
    lengths: tuple[Scalar, Scalar],
    length_acceleration: Scalar,
    hook_mass_ratio: Scalar,
) -> tuple[Scalar, Scalar]:
    """Tension of the rope and of the rigging, both over the hook's mass, in m/s^2.

    n, m are the directions of rope and rigging, `lengths` those of both, `length_acceleration` the rope's L'' in m/s^2,
    `hook_mass_ratio` the hook's mass over the load's. From n.r1'' and m.(r2'' - r1'') of r1 = L1 n, r2 = r1 + L2 m.
    """
    aligned = dot(n, m)
    rope = dot(n, hook_drive) + lengths[0] * dot(n_rate, n_rate) - length_acceleration
    between = dot(m, add(load_drive, scale(-1, hook_drive)))
    rigging = (between + aligned * rope + lengths[1] * dot(m_rate, m_rate)) / (1 + hook_mass_ratio - aligned * aligned)
    return rope + rigging * aligned, rigging


def accelerations_of_two(
    n: Vector,
    n_rate: Vector,
    m: Vector,
    m_rate: Vector,
    hook_drive: Vector,
    load_drive: Vector,
    lengths: tuple[Scalar, Scalar],
    length_rate: Scalar,
    length_acceleration: Scalar,
    hook_mass_ratio: Scalar,
) -> tuple[Vector, Vector]:
    """n'' and m'' in 1/s^2 of rope and rigging; drives are g - a_p + F/m of the hook and of the load."""
    rope, rigging = tensions_of_two(
        n, n_rate, m, m_rate, hook_drive, load_drive, lengths, length_acceleration, hook_mass_ratio
    )
    n_drive = add(hook_drive, scale(rigging, m))
    m_drive = add(add(load_drive, scale(-1, hook_drive)), scale(rope, n))
    return (
        acceleration_of_direction(n, n_rate, n_drive, lengths[0], length_rate),
        acceleration_of_direction(m, m_rate, m_drive, lengths[1], 0.0),
    )


def reference_axis(n: Vector, sin_from_x: Scalar) -> Vector:
    """The unit vector at right angles to n that is nearest to world x; `sin_from_x` is sqrt(1 - n_x^2)."""
    return sin_from_x, -n[0] * n[1] / sin_from_x, -n[0] * n[2] / sin_from_x
