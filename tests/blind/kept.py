"""Cases that are there already: given ones, and those that an earlier campaign made and kept."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.blind.cases import generate
from tests.blind.plan import CATALOGUE, Plan
from tests.blind.write import write_case

Facts = dict[str, Any]
LAST_WRITTEN = "truth.json"
"""A folder without it was left half-written."""


@dataclass(frozen=True, slots=True)
class Given:
    """A case from elsewhere."""

    index: int
    folder: Path


def name_of(plan: Plan) -> str:
    """Of the case's folder."""
    return f"case_{plan.index:03d}"


def of_others(plans: list[Plan], folder: Path) -> list[str]:
    """Cases in the folder that bear the names of these plans and are not theirs."""
    kept = ((plan, _truth(folder / name_of(plan))) for plan in plans)
    return [name_of(plan) for plan, truth in kept if truth is not None and not _is_of(truth, plan)]


def make(plan: Plan, folder: Path) -> Path:
    """The case's folder inside this one; made unless it is there."""
    path = folder / name_of(plan)
    if _truth(path) is None:
        write_case(generate(plan), path)
    return path


def facts_of(case: Path) -> Facts:
    """What a row of the results tells of a case, whoever made it; what its truth does not say is plain."""
    truth = json.loads((case / LAST_WRITTEN).read_text())
    names = truth["effects"].keys()
    kind = "outside" if names - CATALOGUE.keys() else ("null", "single", "pair")[min(len(names), 2)]
    excess = {name: float(f"{value:.3g}") for name, value in truth.get("excess_alone", {}).items()}
    return {
        "seed": truth.get("seed"),
        "kind": truth.get("kind", kind),
        "coloured": truth.get("noise_memory", 0) > 0,
        "jittered": truth.get("jitter_s", 0) > 0,
        "small": truth.get("small", False),
        "excess": excess,
    }


def _truth(case: Path) -> Facts | None:
    try:
        found: Facts = json.loads((case / LAST_WRITTEN).read_text())
    except (FileNotFoundError, json.JSONDecodeError):
        return None
    return found


def _is_of(truth: Facts, plan: Plan) -> bool:
    return truth.get("seed") == plan.seed and truth["effects"].keys() >= set(plan.hidden)
