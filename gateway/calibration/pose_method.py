"""Names of the calibration methods in records, in requests and on the command line."""

from enum import StrEnum


class PoseMethod(StrEnum):
    """A calibration method that fits resting poses; a session and `plumbline calibrate` offer it."""

    SIX_POSITION = "six-position"
    NORM_FIT = "norm-fit"


ZEROING = "zero"
"""Method of a record that zeroing in place has made from its parent."""
THERMAL = "thermal"
"""Method of a record from temperature ramps on all six faces, with a thermal model."""
THERMAL_REST = "thermal-rest"
"""Method of a record with the thermal coefficient of the axis along the rope, learned at rest in service from its parent."""
ROTATION = "rotation"
"""Method of records from full turns about horizontal axes."""
SINGLE_PARAMETER = "single-parameter"
"""Method of records for relative angles alone."""
