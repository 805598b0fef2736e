"""Run the campaign: `python -m tests.alert_campaign --faults 600 --seed 1 --out result.json` (as root)."""

import argparse
import json
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.alert_campaign.faults import TARGETS, Fault, begin_fault
from tests.alert_campaign.site import GATEWAYS, RECEIVERS, Site
from tests.alert_campaign.verdict import judge, sampling

PAUSE_S = (0.8, 3.5)
"""Between the begins of two faults, so that many overlap."""
SETTLE_S = 120.0


def inflict(site: Site, count: int, dice: random.Random) -> Counter[str]:
    """Begin `count` faults, and mend each after its time."""
    begun: Counter[str] = Counter()
    standing: list[tuple[float, Fault]] = []
    next_s = time.monotonic()
    while begun.total() < count or standing:
        time.sleep(0.05)
        now_s = time.monotonic()
        for entry in [each for each in standing if each[0] <= now_s]:
            standing.remove(entry)
            entry[1].mend()
        if begun.total() >= count or now_s < next_s:
            continue
        kind = dice.choice(list(TARGETS))
        target = dice.choice(TARGETS[kind])
        if target not in {fault.target for _, fault in standing}:
            fault = begin_fault(site, kind, target, dice)
            standing.append((now_s + fault.lasts_s, fault))
            begun[kind] += 1
            next_s = now_s + dice.uniform(*PAUSE_S)
            print(f"{begun.total()} {kind} {target} {fault.lasts_s:.1f} s", flush=True)
    return begun


def main() -> int:
    """Run the campaign; 0: nothing lost, repeated or out of order."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("alert_campaign.json"))
    parser.add_argument("--real-time", action="store_true", help="on a busy machine: gateways with real-time priority")
    arguments = parser.parse_args()
    site = Site(Path(tempfile.mkdtemp(prefix="alert-campaign-")), arguments.real_time)
    begin_s = time.monotonic()
    try:
        site.lay()
        for name in ("router", "proxy", *GATEWAYS, *RECEIVERS, "observer"):
            site.start_party(name)
        time.sleep(20.0)
        begun = inflict(site, arguments.faults, random.Random(arguments.seed))
        settled_s = time.monotonic()
        delivered = judge(site)
        while any(each["lost"] for each in delivered.values()) and time.monotonic() < settled_s + SETTLE_S:
            time.sleep(2.0)  # alerts go on: at one time every receiver must have all of them
            delivered = judge(site)
        result = {
            "faults": dict(begun),
            "minutes": round((time.monotonic() - begin_s) / 60, 1),
            "delivered": delivered,
            "sampling": sampling(site),
        }
    finally:
        site.clear()
    arguments.out.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))
    bad = sum(
        each[name] for each in delivered.values() for name in ("lost", "repeated", "out_of_order", "said_to_be_missed")
    )
    if not bad:
        shutil.rmtree(site.folder)
    return 1 if bad else 0


sys.exit(main())
