"""`plumbline remote align`: the two screws of the housing on the rope, turned by somebody who watches the angles."""

import argparse
import sys
import time
from typing import TYPE_CHECKING, TextIO

from gateway.cli.argument_types import above_zero

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient
    from gateway.calibration.alignment.assistant import AligningView
    from gateway.calibration.alignment.screw_advice import AligningAdvice, ScrewMechanics

SILENT_S = 1.5
"""Tilts come ten times a second."""
WAITING = 64
SILENT = "no advice: no readings come; waiting for the gateway"


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> argparse.ArgumentParser:
    """Add the verb; returns its parser."""
    verb = verbs.add_parser(
        "align",
        help="which of the housing's two screws to turn, which way and how far, live",
        description="Shows pitch and roll of the hanging housing and what to turn until both are within 0.03 deg. "
        "Advises only while the load hangs still; ends when it is aligned.",
        epilog="example: plumbline remote align --lead-mm 0.5 --lever-mm 40 --reversed roll",
    )
    verb.add_argument(
        "--lead-mm", type=above_zero, default=0.5, metavar="MM", help="advance of a screw per turn (0.5: M3)"
    )
    verb.add_argument("--lever-mm", type=above_zero, default=40.0, metavar="MM", help="from the hinge to the screw")
    verb.add_argument(
        "--reversed",
        action="append",
        choices=("pitch", "roll"),
        default=[],
        help="this screw makes its angle smaller where it is turned in",
    )
    verb.set_defaults(run=_align)
    return verb


def _align(arguments: argparse.Namespace) -> int:
    from gateway.bus.client import GatewayClient
    from gateway.calibration.alignment.screw_advice import ScrewMechanics

    screws = ScrewMechanics(
        lead_m=arguments.lead_mm / 1000,
        lever_m=arguments.lever_mm / 1000,
        pitch_sign=-1 if "pitch" in arguments.reversed else 1,
        roll_sign=-1 if "roll" in arguments.reversed else 1,
    )
    client = GatewayClient(arguments.connect, arguments.gateway)
    try:
        return watch(client, screws, sys.stdout)
    finally:
        client.close()


def watch(client: "GatewayClient", screws: "ScrewMechanics", out: TextIO) -> int:
    """Show advice as tilts come, until the housing is aligned; a lost link is waited for."""
    import zenoh

    from gateway.calibration.alignment.assistant import Aligning
    from gateway.cli.status_line import StatusLine
    from gateway.daemon.bounded_queue import BoundedQueue
    from gateway.topics import adapter

    tilts: BoundedQueue[zenoh.Sample] = BoundedQueue(WAITING)
    client.subscribe("tilt", tilts.put)
    line, aligning = StatusLine(out), Aligning(screws)
    while True:
        if (sample := tilts.get(SILENT_S)) is None:
            line.update(SILENT, SILENT)
            if client.reconnect():
                client.subscribe("tilt", tilts.put)
            else:
                time.sleep(SILENT_S)
            continue
        view = aligning.add_samples(adapter("tilt").validate_json(sample.payload.to_bytes()))
        if view.advice.state == "aligned":
            known = (
                "" if view.u_calibration_deg is None else f"; by the calibration, u = {view.u_calibration_deg:.3f} deg"
            )
            line.commit(read_out(view) + known)
            return 0
        line.update(read_out(view), _summary_line(view.advice))


def read_out(view: "AligningView") -> str:
    """Both angles and what to do, in less than 80 characters where something is to be turned."""
    advice = view.advice
    todo = advice.text
    if advice.state == "turn":
        todo = f"turn the {advice.screw} screw {advice.direction} by {advice.turns:.2f} turns"
    return f"pitch {_angle(view.pitch_deg)}  roll {_angle(view.roll_deg)} deg: {todo}"


def _angle(value_deg: float | None) -> str:
    return "?" if value_deg is None else f"{value_deg:+.3f}"


def _summary_line(advice: "AligningAdvice") -> str:
    """What makes a line worth another one in a file: not each new digit of an angle."""
    return f"{advice.screw} {advice.direction}" if advice.state == "turn" else advice.text
