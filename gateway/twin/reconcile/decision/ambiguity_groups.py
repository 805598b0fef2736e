"""Effects that physics hardly separates, and what would separate them."""

GROUPS: tuple[tuple[frozenset[str], str], ...] = (
    (
        frozenset({"axis_offset", "mount_misalignment", "steady_wind", "cross_axis"}),
        "turn the housing about the rope by 90 degrees and record again: what stays with the sensor is offset, mount or "
        "cross-axis pick-up, what turns is wind; a wider swing tells a tilt from an offset",
    ),
    (
        frozenset({"axis_offset", "scale_error", "housing_position"}),
        "turn the sensor upside down at rest: an offset keeps its sign, a scale error does not; measure the housing's place",
    ),
    (
        frozenset({"rope_length", "clock_drift", "housing_position"}),
        "measure the rope, or compare the recording's clock with another over some minutes",
    ),
    (
        frozenset({"viscous_damping", "quadratic_drag", "coulomb_friction"}),
        "record from a swing twice as wide until it has died away to a quarter",
    ),
    (
        frozenset({"wind_gust", "trolley_acceleration", "impact", "hoisting"}),
        "repeat the manoeuvre with the drives' own signals recorded, or with a second sensor at the pivot",
    ),
    (
        frozenset({"slewing", "housing_spin"}),
        "repeat with the crane's slewing locked; or look at the housing while the load swings",
    ),
)
PERIOD_LIKE_EFFECTS = frozenset({"rope_length", "housing_position", "clock_drift"})
"""To an end after an event, and beside lost samples, each of these is like another rope."""
UNOBSERVABLE_YAW_EFFECTS = frozenset({"housing_spin", "slewing"})
"""No recording tells these two apart, whatever a fit says."""
DEFAULT_EXPERIMENT = "record for longer and from a wider swing"


def group_of(names: frozenset[str]) -> frozenset[str] | None:
    """A group that holds all of these."""
    return next((group for group, _ in GROUPS if names <= group), None)


def is_superset_of_best(names: frozenset[str], best: frozenset[str]) -> bool:
    """More than the best has, or its twin with the other one of those that turn: what is more has no worth of its own."""
    return names >= best or bool(
        best & UNOBSERVABLE_YAW_EFFECTS
        and names & UNOBSERVABLE_YAW_EFFECTS
        and names - UNOBSERVABLE_YAW_EFFECTS > best - UNOBSERVABLE_YAW_EFFECTS
    )


def ambiguity_partners(names: frozenset[str]) -> frozenset[str]:
    """Others in the groups of these."""
    found = [group for group, _ in GROUPS if group & names]
    return frozenset().union(*found) - names


def discriminating_experiment(names: frozenset[str]) -> str:
    """The measurement or manoeuvre that would tell these apart."""
    return next((text for group, text in GROUPS if names <= group), DEFAULT_EXPERIMENT)
