"""Measurements and manoeuvres that separate effects with the same signature, in an operator's words."""

MEASURE_ROPE = "measure the rope, or compare the recording's clock with another over some minutes"
MEASURE_TO_CENTRE = (
    "measure the length to the load's centre; or swing with another length: an error of the length keeps its share of the "
    "length, the load's inertia loses weight as the rope grows"
)
WEIGH_LOAD = (
    "measure the rope and weigh rope and load; or swing with a heavier load on the same rope, which leaves an error of the "
    "length as it is"
)
MEASURE_HOUSING = (
    "turn the sensor upside down at rest: an offset keeps its sign, a scale error does not; measure the housing's place"
)
TURN_HOUSING = (
    "turn the housing about the rope by 90 degrees and record again: what stays with the sensor is offset, mount or "
    "cross-axis sensitivity, what turns is wind; a wider swing separates a tilt from an offset"
)
RECORD_DRIVES = "repeat the manoeuvre with the drives' own signals recorded, or with a second sensor at the pivot"
LOCK_SLEWING = "repeat with the crane's slewing locked; or look at the housing while the load swings"
SWING_BOTH_WAYS = (
    "swing along the jib or girder, then across it, and compare the periods; or record a second sensor at the pivot"
)
SWING_TO_REST = "let the swing die away until it stops, and compare the periods of large and of small swings"
LARGER_SWING = "record from a swing twice as wide until it has died away to a quarter"
MEASURE_LEVER_ARM = (
    "measure how far beside the rope's line the sensor sits; or turn the housing on its clamp by 180 degrees and record again: "
    "a lever arm changes sides with the housing, a tilt of the sensor in the housing does not"
)
MEASURE_CLAMP = (
    "push the housing across the rope by hand at rest and see whether it turns; tighten its clamp and record again"
)
