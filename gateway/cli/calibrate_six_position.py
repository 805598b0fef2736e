"""`plumbline calibrate six-position`: offset, scale factor and misalignment from the six faces."""

import argparse

from gateway.calibration.pose_method import PoseMethod
from gateway.cli.argument_types import above_zero
from gateway.cli.calibrate_poses import add_pose_arguments, calibrate_poses


def add_to(methods: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the method."""
    method = methods.add_parser(
        PoseMethod.SIX_POSITION.value,
        help="six faces up in turn, on a levelled surface, in any order",
        description="Determine offset, scale factor and misalignment from the six faces, in any order. Repeats are averaged.",
        epilog="example: plumbline calibrate six-position faces.csv --device-id part-7 --json record.json",
    )
    add_pose_arguments(method)
    method.add_argument(
        "--placement-deg",
        type=above_zero,
        metavar="DEG",
        help="standard uncertainty of the faces' placement: level of the surface, squareness of the housing (default 0.1)",
    )
    method.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    return calibrate_poses(arguments, placement_u_deg=arguments.placement_deg)
