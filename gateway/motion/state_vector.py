"""The state vector of the motion filter, in the frame of the housing.

A pair is the two components across the rope. Forces are per unit weight, accelerations per g. The rope's direction n points from
pivot to load. States that change by the equations of motion come first, so that a prediction leaves the others alone.
"""

GRAVITY = slice(0, 2)
"""Transverse components of the unit vector of gravity; their magnitude is the sine of the rope's angle."""
RATE = slice(2, 4)
"""n', the rate of the rope's direction, 1/s."""
PIVOT = slice(4, 6)
"""Horizontal acceleration of the pivot."""
PIVOT_RATE = slice(6, 8)
"""Its time derivative, 1/s."""
GUST = slice(8, 10)
"""Horizontal force on the load that changes within seconds: turbulence, a gust."""
SIDE_FORCE = slice(10, 12)
"""Steady horizontal force on the load, as of the mean wind; it makes the rope lean."""
PIVOT_VELOCITY = slice(12, 14)
"""Horizontal velocity of the pivot by its accelerations of the last minute, m/s."""
SPIN = 14
"""Rate at which the housing turns about the rope, 1/s; what is fixed to the world turns the other way in its frame."""
LN_LENGTH = 15
"""ln(L/m), L the length of a pendulum that swings as the load does."""
HOIST_SPEED = 16
"""L', lowering positive, m/s."""
HOIST_ACCELERATION = 17
"""L'', m/s^2."""
HEAVE = 18
"""Vertical acceleration of the pivot, as of a yielding jib or a floating base."""
HEAVE_RATE = 19
"""Its time derivative, 1/s."""
OFFSET = slice(20, 22)
"""Constant part of the transverse reading: zero-g offset plus MOUNT, g."""
MOUNT = slice(22, 24)
"""Tilt of the housing's z axis against the rope, rad."""
AXIAL_OFFSET = 24
"""Constant part of the axial reading: zero-g offset and scale error, g."""
DAMPING = 25
"""Viscous damping rate c, 1/s."""
PLACE = 26
"""Distance of the housing from the end of the rope from which it is stated, m: load or pivot. On a spreader, which does not turn
with the ropes: its tilt against theirs, per angle of the ropes."""
LEVER = slice(27, 29)
"""Place of the accelerometer beside the rope's axis, m. On a spreader: difference of its tilt in two
directions, as of STIFFNESS."""
STIFFNESS = slice(29, 31)
"""Relative difference of the stiffness in two directions, as components of a symmetric matrix without trace: along x against y,
and along the diagonals. Ropes that converge, and falls that are fixed at both ends, hang stiffer in one plane."""
LINE = slice(31, 33)
"""Reading of a fast oscillation that is no swing: a string mode of the rope, a load under its hook, a vibration; g."""
LINE_RATE = slice(33, 35)
"""Its time derivative, g/s."""
N_STATES = 35
"""Definition: without a gyroscope."""
GYRO_BIAS = slice(35, 38)
"""Reading of the gyroscope at rest, 1/s."""
GYRO_SCALE = slice(38, 40)
"""Relative scale errors of the gyroscope about x and y."""
N_GYRO_STATES = 5
"""Definition: behind the others where there is a gyroscope."""
TURNING = slice(0, 14)
"""Pairs that keep their direction in the world while the housing turns."""
N_MOVING = 20
"""States that change by the equations of motion; of the others, the constants return slowly to what was stated."""


def indices(states: slice | int) -> list[int]:
    """Return the places of a state or of a pair."""
    return [states] if isinstance(states, int) else list(range(states.start, states.stop))
