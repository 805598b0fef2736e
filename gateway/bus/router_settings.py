"""The configuration of the router of a fleet: for zenohd as a file, and for a session in router mode."""

from collections.abc import Mapping, Sequence
from typing import Any

from gateway.bus.access_control import EVERY_GATEWAY, READ, WRITE
from gateway.bus.session import ACCEPT_MS, LARGEST_ANSWER, LEASE_MS, LONGEST_BLOCKED_US, MOST_PENDING, TlsFiles
from gateway.topics import STATE_TOPICS

CLEANING = {"period": 3600, "lifespan": 86400}
"""Seconds between cleanings, and for which an unused entry lives. Basis: a choice; an hour and a day, so that nothing of a
running site is lost."""


def router_configuration(
    listen: Sequence[str],
    tls: TlsFiles | None = None,
    gateways: Mapping[str, str] | None = None,
    readers: Sequence[str] = (),
    load_signals: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the router's configuration; `gateways`: common name of each gateway's certificate by its key.

    With certificates everything is denied that is not allowed: a gateway publishes and answers under its own key alone, readers
    read and send requests, which each gateway authorises itself.
    """
    link: dict[str, Any] = {
        "tx": {
            "lease": LEASE_MS,
            "queue": {"congestion_control": {"block": {"wait_before_close": LONGEST_BLOCKED_US}}},
        },
        "rx": {"max_message_size": LARGEST_ANSWER},
    }
    configuration: dict[str, Any] = {
        "mode": "router",
        "listen": {"endpoints": list(listen)},
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True},  # storages keep the newest message by its time stamp
        "transport": {
            "unicast": {"accept_pending": MOST_PENDING, "accept_timeout": ACCEPT_MS},
            "link": link,
            "shared_memory": {"enabled": False},
        },
    }
    if tls is not None:
        link["tls"] = tls.settings()
        configuration["access_control"] = _access(gateways or {}, readers, load_signals)
    return configuration


def with_storage(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """Add zenohd's storage manager, which keeps the last messages in memory."""
    storages = {
        topic: {"key_expr": f"plumbline/v1/*/*/*/{topic}", "volume": "memory", "garbage_collection": CLEANING}
        for topic in STATE_TOPICS
    }
    return {
        **configuration,
        "plugins_loading": {"enabled": True},
        "plugins": {"storage_manager": {"__required__": True, "storages": storages}},
    }


def _access(gateways: Mapping[str, str], readers: Sequence[str], load_signals: Sequence[str]) -> dict[str, Any]:
    rules = [
        _rule("deliver", [*WRITE, *READ], "egress", [EVERY_GATEWAY]),
        _rule("read", READ, "ingress", [EVERY_GATEWAY]),
        _rule("load_signal", ["put"], "ingress", ["plumbline/v1/*/*/*/load"]),
    ]
    everybody = {"id": "everybody"}
    subjects: list[dict[str, Any]] = [everybody]
    policies: list[dict[str, Any]] = [{"subjects": ["everybody"], "rules": ["deliver"]}]
    for names, rule in ((readers, "read"), (load_signals, "load_signal")):
        if names:
            subjects.append({"id": f"{rule}ers", "cert_common_names": list(names)})
            policies.append({"subjects": [f"{rule}ers"], "rules": [rule]})
    for key, name in gateways.items():
        place = key.removeprefix("plumbline/v1/")
        rules.append(_rule(f"write {place}", [*WRITE, *READ], "ingress", [f"{key}/**"]))
        subjects.append({"id": place, "cert_common_names": [name]})
        policies.append({"subjects": [place], "rules": [f"write {place}"]})
    return {"enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies}


def _rule(name: str, messages: Sequence[str], flow: str, key_expressions: list[str]) -> dict[str, Any]:
    return {
        "id": name,
        "messages": list(messages),
        "flows": [flow],
        "permission": "allow",
        "key_exprs": key_expressions,
    }
