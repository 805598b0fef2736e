"""`plumbline calibrate norm-fit`: offset, scale factor and non-orthogonality from |m| = 1 g in many attitudes."""

import argparse

from gateway.calibration.pose_method import PoseMethod
from gateway.cli.argument_types import above_zero
from gateway.cli.calibrate_poses import add_pose_arguments, calibrate_poses


def add_to(methods: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the method."""
    method = methods.add_parser(
        PoseMethod.NORM_FIT.value,
        help="nine or more poses in all directions; no levelled surface needed",
        description="Determine offset, scale factor and non-orthogonality from |m| = 1 g in nine or more attitudes in all "
        "directions. Twelve are better, because the additional poses check the fit.",
        epilog="example: plumbline calibrate norm-fit session.csv --unit counts --rate 100 --json record.json",
    )
    add_pose_arguments(method)
    method.add_argument(
        "--frame-deg",
        type=above_zero,
        metavar="DEG",
        help="standard uncertainty of the attitude of the sensor's axes in the housing, which this method does not measure "
        "(default 0.58)",
    )
    method.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    return calibrate_poses(arguments, frame_u_deg=arguments.frame_deg)
