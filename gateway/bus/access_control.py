"""Access control of a gateway's own bus session, by Zenoh's rules: what is not allowed is denied.

A rule allows a key expression that lies within its own, so that a wildcard publication cannot slip past an allowed list, as it
would past a list of denied keys. Messages are checked at every link of this session; behind a router the router's rules hold.
"""

from collections.abc import Sequence
from typing import Any

from gateway.configuration.bus_section import BusSection

READ = ("declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber")
WRITE = ("put", "delete", "declare_queryable", "reply", "liveliness_token")
EVERYTHING, EVERY_GATEWAY = "**", "plumbline/v1/**"


def access_control(bus: BusSection, key: str) -> dict[str, Any]:
    """Return the access control of the session of the gateway with a key."""
    access, forwarded = bus.access, [part for prefix in bus.forward for part in (prefix, f"{prefix}/**")]
    publications = [f"{key}/**", *forwarded]
    rules = [
        access_rule("send", WRITE, "egress", publications if not access.routers else [*publications, EVERY_GATEWAY]),
        access_rule("ask_others", READ, "egress", [EVERYTHING]),
        access_rule("read", READ, "ingress", [EVERYTHING]),
        access_rule("load_signal", ("put",), "ingress", [f"{key}/load"]),
        access_rule("boot", ("liveliness_token",), "ingress", [f"{key}/alive/**"]),
        access_rule("route", WRITE, "ingress", [EVERY_GATEWAY]),
    ]
    if forwarded:
        rules.append(access_rule("forward", WRITE, "ingress", forwarded))
    subjects, policies = _policies(bus, ["forward"] if forwarded else [])
    return deny_all_but(rules, subjects, policies)


def _policies(bus: BusSection, forward: list[str]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the subjects, and the rules that are theirs."""
    access = bus.access
    readers = [*access.operators, *access.services]
    everybody = ["send", "ask_others", "boot", *forward]
    if not readers:
        everybody.append("read")
    if not access.load_signals:
        everybody.append("load_signal")
    named: tuple[tuple[str, Sequence[str], list[str]], ...] = (
        ("readers", readers, ["read"]),
        ("load_signals", access.load_signals, ["read", "load_signal"]),
        ("routers", access.routers, ["read", "load_signal", "route"]),
    )
    subjects: list[dict[str, Any]] = [{"id": "everybody"}]
    policies = [{"subjects": ["everybody"], "rules": everybody}]
    for subject, names, rules in named:
        if names:
            subjects.append({"id": subject, "cert_common_names": list(names)})
            policies.append({"subjects": [subject], "rules": rules})
    return subjects, policies


def deny_all_but(
    rules: list[dict[str, Any]], subjects: list[dict[str, Any]], policies: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return the access control that denies what the rules do not allow to the subjects of their policies."""
    access = {"rules": rules, "subjects": subjects, "policies": policies}
    return {"enabled": True, "default_permission": "deny", **access}


def access_rule(name: str, messages: Sequence[str], flow: str, key_expressions: list[str]) -> dict[str, Any]:
    """Return a rule that allows messages of these kinds, in one direction of flow, within these key expressions."""
    return {
        "id": name,
        "messages": list(messages),
        "flows": [flow],
        "permission": "allow",
        "key_exprs": key_expressions,
    }
