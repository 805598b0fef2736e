"""What the receivers got, against what the gateways have stored."""

import json
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gateway.outbox import AlertOutbox, Position
from tests.alert_campaign.site import GATEWAYS, RECEIVERS, Site

Change = tuple[str, int]
BLOCK_MS = 100.0
STARTING_BLOCKS = 20
"""The first blocks of a boot, which wait for its threads to start, are left out."""


@dataclass
class Delivery:
    """The changes of one gateway at one receiver."""

    got: list[Change] = field(default_factory=list)
    missed: list[list[int | None]] = field(default_factory=list)


def sent_changes(folder: Path) -> list[Change]:
    """Return all changes in an outbox."""
    page = AlertOutbox(folder / "alerts").page_after(Position(0), most_bytes=10**9)
    return [(change.boot_id, change.number) for change in page.changes]


def lines_of(path: Path) -> list[dict[str, Any]]:
    """Return the complete lines of a file."""
    if not path.exists():
        return []
    content = path.read_bytes()
    return [json.loads(line) for line in content[: content.rfind(b"\n") + 1].splitlines()]


def deliveries(path: Path) -> dict[str, Delivery]:
    """Return what a receiver got, by crane."""
    found: dict[str, Delivery] = defaultdict(Delivery)
    for line in lines_of(path):
        crane = line["gateway"].split("/")[3]
        if "number" in line:
            found[crane].got.append((line["boot"], line["number"]))
        elif "missed" in line:
            found[crane].missed.append(line["missed"])
    return found


def judge(site: Site) -> dict[str, Any]:
    """Return, for each receiver and crane, how many changes were sent, got, lost, repeated, out of order, unknown."""
    result: dict[str, Any] = {}
    for receiver in RECEIVERS:
        found = deliveries(site.log_of(receiver))
        for crane in GATEWAYS:
            sent, got = sent_changes(site.folder / crane), found[crane].got
            place = {change: index for index, change in enumerate(sent)}
            places = [place[change] for change in got if change in place]
            result[f"{receiver} {crane}"] = {
                "sent": len(sent),
                "boots": len({boot for boot, _ in sent}),
                "lost": len(set(sent) - set(got)),
                "repeated": len(got) - len(set(got)),
                "out_of_order": int(np.sum(np.diff(places) <= 0)) if len(places) > 1 else 0,
                "not_in_the_outbox": sum(change not in place for change in got),
                "said_to_be_missed": len(found[crane].missed),
            }
    return result


def sampling(site: Site) -> dict[str, Any]:
    """Return the delays of blocks at the observer, and what the gateways lost or dropped."""
    lines = lines_of(site.folder / "observed.jsonl")
    blocks = [line for line in lines if line["topic"] == "samples" and line["sequence"] >= STARTING_BLOCKS]
    delays_ms = np.array([line["delay_ms"] for line in blocks])
    last: dict[str, dict[str, Any]] = {line["boot_id"]: line for line in lines if line["topic"] == "health"}
    latencies = [each["alert_latency_ms"] for each in last.values() if each["alert_latency_ms"]]
    return {
        "blocks": len(delays_ms),
        "delay_ms": {
            name: round(float(np.percentile(delays_ms, q)), 2)
            for name, q in (("p50", 50), ("p99", 99), ("p99.9", 99.9), ("max", 100))
        },
        "later_than_a_block": int(np.sum(delays_ms > BLOCK_MS)),
        "boots": len(last),
        "lost_samples": sum(each["lost"] for each in last.values()),
        "dropped_blocks": sum(each["dropped"]["blocks"] for each in last.values()),
        "dropped_bus": sum(each["dropped"]["bus"] for each in last.values()),
        "alerts_not_stored": sum(each["faults"].get("alerts_not_stored", 0) for each in last.values()),
        "alert_latency_ms": {
            "p50_median_of_boots": round(float(np.median([each["p50"] for each in latencies])), 2),
            "max": max(each["max"] for each in latencies),
        }
        if latencies
        else None,
    }
