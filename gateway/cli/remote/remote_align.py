"""`plumbline remote align`: live advice for a person who turns the two screws of the housing on the rope."""

import argparse
import sys
import time
from typing import TYPE_CHECKING, Any, TextIO

from gateway.cli.argument_types import above_zero
from gateway.cli.bus_link import ADDRESS_OPTIONS, gateway_client
from gateway.cli.calibrate.calibrate_align import UNIT_OPTIONS, aligning_unit
from gateway.cli.command import command, option

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient
    from gateway.calibration.alignment.assistant import AlignmentReadout, ScrewAdvice, ScrewMechanics
    from gateway.calibration.alignment.turn_assistant import TurnAssistant
    from gateway.cli.output import StatusLine
    from gateway.messages import Tilt

TILT_SILENCE_S = 1.5
"""Time without a tilt, s, after which the link is opened again; tilts arrive ten times per second. Basis: fifteen tilts."""
MAX_QUEUED_TILTS = 64
"""Tilts that may wait. Basis: a choice; six seconds, and the newest count."""
SILENCE_TEXT = "no advice: no readings arrive; waiting for the gateway"


@command(
    "align",
    "show live which of the housing's two screws to turn, which way and how far",
    "Show pitch and roll of the hanging housing, and which screw to turn until both are within 0.03 deg. "
    "It gives advice only while the load hangs still, and ends when the housing is aligned.",
    "example: plumbline remote align --lead-mm 0.5 --lever-mm 40 --reversed roll",
    option(
        "--lead-mm", type=above_zero, default=0.5, metavar="MM", help="advance of a screw per turn (default 0.5, M3)"
    ),
    option(
        "--lever-mm",
        type=above_zero,
        default=40.0,
        metavar="MM",
        help="distance from the hinge to the screw (default 40)",
    ),
    option(
        "--reversed",
        action="append",
        choices=("pitch", "roll"),
        default=[],
        help="turning this screw in decreases its angle; may be repeated",
    ),
    option(
        "--on-shaft",
        action="store_true",
        help="align the sensor in its housing instead: turn it slowly about a horizontal shaft along one axis; shows the "
        "peak-to-peak of the last turn, its floor, and which aligning screw to turn, until the axis is aligned",
    ),
    option("--axis", choices=tuple("xyz"), help="on a shaft: the sensor's axis along it (default: it is found)"),
    *UNIT_OPTIONS,
    *ADDRESS_OPTIONS,
)
def run_align(arguments: argparse.Namespace) -> int:
    """Show advice until the housing, or the sensor on a shaft, is aligned."""
    from gateway.calibration.alignment.assistant import ScrewMechanics

    if arguments.on_shaft:
        return _align_on_shaft(arguments)
    screws = ScrewMechanics(
        lead_m=arguments.lead_mm / 1000,
        lever_m=arguments.lever_mm / 1000,
        pitch_sign=-1 if "pitch" in arguments.reversed else 1,
        roll_sign=-1 if "roll" in arguments.reversed else 1,
    )
    with gateway_client(arguments) as client:
        return show_advice(client, screws, sys.stdout)


def _align_on_shaft(arguments: argparse.Namespace) -> int:
    from gateway.calibration.alignment.turn_assistant import TurnAssistant

    axis = None if arguments.axis is None else "xyz".index(arguments.axis)
    with gateway_client(arguments) as client:
        return show_turns(client, TurnAssistant(aligning_unit(arguments), axis), sys.stdout)


def show_turns(client: "GatewayClient", assistant: "TurnAssistant", out: TextIO) -> int:
    """Show the read-out of the turns until the axis is aligned, or as far as its screws reach; wait if the link is lost."""
    from gateway.calibration.alignment.turn_assistant import format_errors, format_turn
    from gateway.cli.output import StatusLine

    in_force = ((client.status() or {}).get("calibration") or {}).get("in_force") or {}
    assistant.set_gain(in_force.get("gain_g_per_unit"))
    line, n_shown = StatusLine(out), 0
    tilts = TiltFeed(client, line)
    while True:
        view = assistant.add_tilt(tilts.next())
        if view is None:
            text = "turn the sensor about a horizontal shaft; it hangs, or lies still"
            line.update(text, text)
        elif view.n_turns > n_shown and view.advice is not None:
            n_shown = view.n_turns
            line.commit(format_turn(view))
            if view.advice.state in ("aligned", "converged"):
                line.commit(format_errors(view))
                return 0
        else:
            line.update(format_turn(view), f"turn {view.n_turns + 1}")


def show_advice(client: "GatewayClient", screws: "ScrewMechanics", out: TextIO) -> int:
    """Show advice for each tilt until the housing is aligned; wait if the link is lost."""
    from gateway.calibration.alignment.assistant import AlignmentAssistant
    from gateway.cli.output import StatusLine

    line, assistant = StatusLine(out), AlignmentAssistant(screws)
    tilts = TiltFeed(client, line)
    while True:
        view = assistant.add_tilt(tilts.next())
        if view.advice.state == "aligned":
            uncertainty = (
                "" if view.u_calibration_deg is None else f"; by the calibration, u = {view.u_calibration_deg:.3f} deg"
            )
            line.commit(format_view(view) + uncertainty)
            return 0
        line.update(format_view(view), _summary_line(view.advice))


class TiltFeed:
    """The tilts of a gateway, one after the other."""

    def __init__(self, client: "GatewayClient", line: "StatusLine") -> None:
        """`line` says when no tilt comes."""
        from gateway.daemon.runtime.worker import BoundedQueue

        self._client = client
        self._line = line
        self._tilts: BoundedQueue[dict[str, Any]] = BoundedQueue(MAX_QUEUED_TILTS)
        client.subscribe("tilt", self._tilts.put)

    def next(self) -> "Tilt":
        """Return the next tilt; while none comes, say so and connect again."""
        from gateway.topics import adapter

        while (tilt := self._tilts.get(TILT_SILENCE_S)) is None:
            self._line.update(SILENCE_TEXT, SILENCE_TEXT)
            if self._client.reconnect():
                self._client.subscribe("tilt", self._tilts.put)
            else:
                time.sleep(TILT_SILENCE_S)
        message: Tilt = adapter("tilt").validate_python(tilt)
        return message


def format_view(view: "AlignmentReadout") -> str:
    """Return both angles and what to do, in less than 80 characters if a screw is to be turned."""
    advice = view.advice
    action = advice.text
    if advice.state == "turn":
        action = f"turn the {advice.screw} screw {advice.direction} by {advice.turns:.2f} turns"
    return f"pitch {_angle(view.pitch_deg)}  roll {_angle(view.roll_deg)} deg: {action}"


def _angle(value_deg: float | None) -> str:
    return "?" if value_deg is None else f"{value_deg:+.3f}"


def _summary_line(advice: "ScrewAdvice") -> str:
    """Return what starts a new line in a file when it changes: the advice without the digits of an angle."""
    return f"{advice.screw} {advice.direction}" if advice.state == "turn" else advice.text
