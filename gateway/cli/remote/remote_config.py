"""`plumbline remote config`: read a gateway's configuration, propose a change, and apply it on trial."""

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.bus_link import ADDRESS_OPTIONS, gateway_client
from gateway.cli.command import AddTo, Command, Run, option
from gateway.cli.remote.remote_session import ask, new_request
from gateway.errors import ANSWER_IS_NO, printable

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient, RpcReply

AGAIN = "; try again"
TRIAL_S = 240.0
"""Longest wait for the end of a trial: some starts of a gateway that does not become healthy. Basis: a trial has three starts of
60 s."""
TRIAL_POLL_S = 1.0
"""Time between two questions. Basis: a choice; a trial takes seconds to minutes."""


def _get(arguments: argparse.Namespace) -> int:
    import tomli_w

    reply = _ask(arguments, "config_get", {})
    if not reply.accepted:
        return _refused(reply)
    sys.stdout.write(tomli_w.dumps(reply.content["configuration"]))
    return 0


def _propose(arguments: argparse.Namespace) -> int:
    from gateway.configuration.loading import read_table
    from gateway.configuration.proposal import KeyChange

    keep = arguments.action == "propose"
    more = {"proposal": read_table(arguments.file), "allow_network": arguments.allow_network, "keep": keep}
    reply = _ask(arguments, "config_propose", more)
    if not reply.accepted:
        return _refused(reply)
    for change in reply.content["changes"]:
        print(KeyChange.model_validate(change))
    if keep:
        if voided := reply.content.get("voids"):
            print(f"the proposal before, {printable(str(voided))}, is void: one is kept at a time")
        print(f"to apply it: plumbline remote config apply {reply.content['proposal']} --by {arguments.by}")
    return 0


def _apply(arguments: argparse.Namespace) -> int:
    with gateway_client(arguments) as client:
        request = new_request(arguments, {"proposal": arguments.proposal})
        reply = ask(client, "config_apply", request, AGAIN)
        if not reply.accepted:
            return _refused(reply)
        print(f"{reply.text}; the gateway starts again ...", flush=True)
        return _wait_for_end(client, arguments, request["id"])


def _wait_for_end(client: "GatewayClient", arguments: argparse.Namespace, request_id: str) -> int:
    """Wait until a change is confirmed or rolled back; return the exit code."""
    end_s = time.monotonic() + TRIAL_S
    while time.monotonic() < end_s:
        time.sleep(TRIAL_POLL_S)
        reply = client.ask("config_get", new_request(arguments, {}), 0.0)
        if reply is None:
            client.reconnect()
            continue
        for entry in reply.content.get("history", []):
            if entry.get("id") == request_id and entry.get("event") == "confirmed":
                print("confirmed: the gateway is healthy")
                return 0
            if entry.get("id") == request_id and entry.get("event") == "rolled_back":
                print(f"rolled back: {entry.get('why')}", file=sys.stderr)
                return ANSWER_IS_NO
    print(f"no confirmation within {TRIAL_S:.0f} s; see: plumbline remote status", file=sys.stderr)
    return ANSWER_IS_NO


def _ask(arguments: argparse.Namespace, verb: str, more: dict[str, Any]) -> "RpcReply":
    with gateway_client(arguments) as client:
        return ask(client, verb, new_request(arguments, more), AGAIN)


def _refused(reply: "RpcReply") -> int:
    print(f"refused: {reply.text}", file=sys.stderr)
    return ANSWER_IS_NO


def _action(name: str, description: str, run: Run, example: str, *options: AddTo) -> Command:
    return Command(
        name=name,
        help=description[0].lower() + description.rstrip(".")[1:],
        description=description,
        epilog=f"example: plumbline remote config {name} {example}",
        options=[
            *options,
            option("--by", required=True, metavar="NAME", help="your name, for the audit"),
            option("--reason", default="", metavar="TEXT", help="reason, for the audit"),
            *ADDRESS_OPTIONS,
        ],
        run=run,
    )


CHANGE_OPTIONS = (
    option("file", type=Path, metavar="FILE", help="sections that take the place of the present ones"),
    option(
        "--allow-network",
        action="store_true",
        help="permit changes of names and listeners, by which the gateway is reached",
    ),
)
config = Command(
    name="config",
    help="read, propose and apply the configuration of a gateway",
    description="Read the configuration of a gateway, propose a change, and apply it. The gateway starts again with the "
    "change, and puts the configuration before back where it does not become healthy.",
    epilog="examples: plumbline remote config get --by ann > crane.toml | "
    "plumbline remote config propose crane.toml --by ann | plumbline remote config apply ID --by ann",
    part="action",
    verbs=[
        _action("get", "Print the configuration as TOML, without secrets, files and commands.", _get, "--by ann"),
        _action(
            "propose",
            "Check a change and keep it; print what it changes.",
            _propose,
            "crane.toml --by ann",
            *CHANGE_OPTIONS,
        ),
        _action("validate", "Check a change; print what it changes.", _propose, "crane.toml --by ann", *CHANGE_OPTIONS),
        _action(
            "apply",
            "Put a proposal into force, and wait until it is confirmed.",
            _apply,
            "ID --by ann",
            option("proposal", metavar="ID", help="id that `propose` printed"),
        ),
    ],
)
