"""The state vector of the motion filter, in the frame of the housing.

A pair is the two components across the rope. Forces are per unit weight (1 is g). The rope's direction n points from pivot to
load. States that change by the equations of motion come first, so that a prediction leaves the others alone.
"""

GRAVITY = slice(0, 2)
"""Transverse components of the unit vector of gravity; their magnitude is the sine of the rope's angle."""
RATE = slice(2, 4)
"""n', the rate of the rope's direction, 1/s."""
INPUT = slice(4, 6)
"""What the hypothesis lets act: horizontal acceleration of the pivot over g, or the force of a gust on the load per weight."""
INPUT_RATE = slice(6, 8)
"""Its time derivative, 1/s."""
SIDE_FORCE = slice(8, 10)
"""Steady horizontal force on the load per weight, as of a constant wind; it makes the rope lean."""
PIVOT_VELOCITY = slice(10, 12)
"""Horizontal velocity of the pivot by its accelerations of the last minute, m/s."""
SPIN = 12
"""Rate at which the housing turns about the rope, 1/s; everything but OFFSET and MOUNT turns the other way in its frame."""
LN_LENGTH = 13
"""ln(L/m)."""
HOIST_SPEED = 14
"""L', lowering positive, m/s."""
HOIST_ACCELERATION = 15
"""L'', m/s^2."""
OFFSET = slice(16, 18)
"""Constant part of the transverse reading: zero-g offset plus MOUNT, g."""
MOUNT = slice(18, 20)
"""Tilt of the housing's z axis against the rope, rad."""
AXIAL_OFFSET = 20
"""Constant part of the axial reading: zero-g offset and scale error, g."""
DAMPING = 21
"""Viscous damping rate c, 1/s."""
PLACE = 22
"""Distance of the housing from the end of the rope from which it is stated: load or pivot, m."""
LINE = slice(23, 25)
"""Force of a fast oscillation on the load (a load that swings under its hook, a rope that vibrates) per weight."""
LINE_RATE = slice(25, 27)
"""Its time derivative, 1/s."""
N_STATES = 27
"""Definition: without a gyroscope."""
GYRO_BIAS = slice(27, 30)
"""Reading of the gyroscope at rest, 1/s."""
GYRO_SCALE = slice(30, 32)
"""Relative scale errors of the gyroscope about x and y."""
N_GYRO_STATES = 5
"""Definition: behind the others where there is a gyroscope."""
TURNING = slice(0, 12)
"""Pairs that keep their direction in the world while the housing turns."""
MOVING = slice(0, 15)
"""States that change by the equations of motion; without a fast oscillation all others are constant or walk randomly."""
