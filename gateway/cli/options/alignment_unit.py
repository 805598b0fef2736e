"""Options that describe the screws of the aligning unit in a housing."""

import argparse
from typing import TYPE_CHECKING

from gateway.cli.options.argument_types import above_zero

if TYPE_CHECKING:
    from gateway.calibration.alignment.turn_advice import AligningUnit


def add_unit_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "--unit-lead-mm",
        type=above_zero,
        default=0.5,
        metavar="MM",
        help="lead of an aligning screw (default 0.5, M3)",
    )
    parser.add_argument(
        "--unit-lever-mm",
        type=above_zero,
        default=10.0,
        metavar="MM",
        help="distance from the hinge to that screw (default 10)",
    )
    parser.add_argument(
        "--unit-reversed",
        action="append",
        choices=tuple("xyz"),
        default=[],
        help="turning in the screw about this axis turns the unit in the negative sense; may be repeated",
    )
    parser.add_argument(
        "--own-units",
        action="store_true",
        help="each axis has an aligning unit of its own with two screws (default: one unit, three screws)",
    )


def aligning_unit(arguments: argparse.Namespace) -> "AligningUnit":
    """Return the unit that the options describe."""
    from gateway.calibration.alignment.turn_advice import OWN_SCREWS, SHARED_SCREWS, AligningUnit

    return AligningUnit(
        lead_m=arguments.unit_lead_mm / 1000,
        lever_m=arguments.unit_lever_mm / 1000,
        reversed_axes=frozenset(arguments.unit_reversed),
        screws=OWN_SCREWS if arguments.own_units else SHARED_SCREWS,
    )
