"""Reconciliations made by hand, one for each verdict."""

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from gateway.twin.effects import EFFECTS
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import (
    Candidate,
    Comparison,
    Curves,
    DataPart,
    Disagreement,
    Estimate,
    Gap,
    NamedEffect,
    Peak,
    Reconciliation,
    Remainder,
    Residual,
    Step,
)
from gateway.twin.report.page import render_report
from tests.gateway.twin.report.report_page import Pages
from tests.values import present

RIG = TwinRig(14.0, 5.0, 9.80665, (3e-4, 3e-4, 3e-4), 50.0, 2.0)
SWING_RAD_S = math.sqrt(RIG.gravity_m_s2 / RIG.length_m)
BLOW_S = 36.65
TITLE = "Crane 3 " + "x" * 200
PENDULUM = ("n'' = (I − n nᵀ)(g − a_p + F/m)/L − |n'|² n", "f = a_p + r n'' − g")

Maker = Callable[..., Reconciliation]


def curves(duration_s: float = 60.0, changed: bool = True) -> Curves:
    """A swing; the model as believed misses a blow at `BLOW_S`, the final one does not."""
    time_s = np.arange(0.0, duration_s, 0.02)
    noise_g = np.array(RIG.noise_g)
    phase = SWING_RAD_S * time_s
    before_g = np.stack([0.02 * np.cos(phase), 0.01 * np.sin(phase), 1 + 1e-4 * np.cos(2 * phase)], axis=1)
    blow = np.where(time_s > BLOW_S, np.sin(SWING_RAD_S * (time_s - BLOW_S)), 0.0)
    after_g = before_g + 5e-3 * blow[:, None] * [1.0, -1.0, 0.0]
    measured_g = after_g + noise_g * np.random.default_rng(1).standard_normal(after_g.shape)
    used = np.ones(len(time_s), dtype=bool)
    used[0] = False
    return Curves(time_s, measured_g, before_g, after_g if changed else before_g, used, noise_g)


def named(name: str, when_s: tuple[float, float] | None = None) -> NamedEffect:
    """An effect of the vocabulary with its typical values."""
    effect = EFFECTS[name]
    estimates = {}
    for p in effect.parameters:
        low, high = (
            tuple(v * k for v in p.typical) if isinstance(p.typical, tuple) else p.typical * k for k in (0.9, 1.1)
        )
        estimates[p.name] = Estimate(
            p.typical, (low, high), p.unit, p.meaning, True, components=p.components, refitted=p.refitted
        )
    return NamedEffect(name, effect.explains, effect.equation, estimates, when_s)


COMPARED = Comparison(
    log=curves(),
    held_out=curves(45.0),
    held_out_is_last_third=False,
    parts=(
        DataPart("fit", "log", ((0.0, 60.0),), 3000),
        DataPart("selection", "held_out", ((0.0, 8.0), (12.0, 20.0)), 800),
        DataPart("test", "held_out", ((8.0, 12.0), (20.0, 24.0)), 400),
    ),
    disagreement=(Disagreement("x", 37.0, 60.0, (0.1, 0.2), 11.7), Disagreement("y", 37.0, 60.0, (0.1, 0.2), 11.2)),
    gap=Gap(232.0, 213.0, 213.0, 0.99, 1.01, 1.01, (108.0, 259.0)),
    residual=Residual(True, 0.42, ()),
    remainder=Remainder(0.0, 0.34, 0.0, 0.0, "along the swing", None, None, None),
)
WITHOUT_GAIN = replace(COMPARED, log=curves(changed=False), held_out=curves(45.0, changed=False))
BASE = Reconciliation(
    verdict="named",
    reason="no rival comes near",
    reason_code="unique",
    comparison=COMPARED,
    rig=RIG,
    effects=(named("viscous_damping"), named("impact", (BLOW_S, BLOW_S))),
    candidates=(),
    split_by=None,
    steps=(
        Step((), (), (), 232.0, 213.0, 1.4e6),
        Step(("viscous_damping",), (), ("viscous_damping",), 15.3, 29.8, 9e4),
        Step(("impact",), ("axis_offset",), ("viscous_damping", "impact"), 0.99, 1.01, 6e3),
    ),
    ranking=(
        Candidate(("viscous_damping", "impact"), 0.99, 1.01, 6000.0, 0.0, rival=False),
        Candidate(("coulomb_friction", "impact"), 1.19, None, 6100.0, 100.0, rival=False),
        Candidate((), 232.0, 213.0, 1.4e6, 1.39e6, rival=False),
    ),
    equations_before=PENDULUM,
    equations_after=(*PENDULUM, "viscous_damping: F/m = −2 ζ √(g/L) v"),
    refitted_on_held_out=("initial.tilt_x_rad", "initial.tilt_y_rad"),
    counts={"read": 3000, "used": 2999, "spikes": 1, "lost": 0},
    model={"viscous_damping": {"damping_ratio": 0.00714}, "impact": {"delta_v_m_s": (0.07, -0.11), "start_s": BLOW_S}},
)
UNCHANGED: dict[str, Any] = {
    "effects": (),
    "steps": (BASE.steps[0],),
    "equations_after": PENDULUM,
    "model": {},
    "comparison": WITHOUT_GAIN,
}
VERDICTS: dict[str, dict[str, Any]] = {
    "data_unusable": {
        **UNCHANGED,
        "reason": "the recording lasts 3.2 s; record at least 60 s",
        "steps": (),
        "ranking": (),
        "comparison": None,
        "equations_before": (),
        "equations_after": (),
        "refitted_on_held_out": (),
    },
    "none_missing": {
        **UNCHANGED,
        "comparison": replace(WITHOUT_GAIN, disagreement=(), gap=Gap(1.0, 1.02, 1.02, 1.0, 1.02, 1.02, (0.0, 0.0))),
    },
    "named": {},
    "one_of": {
        "effects": (named("steady_wind"), named("viscous_damping")),
        "candidates": ("steady_wind", "axis_offset", "mount_misalignment"),
        "split_by": "turn the housing by 90° about the rope and record again",
    },
    "named_with_remainder": {
        "leaves_remainder": True,
        "effects": (named("viscous_damping"),),
        "comparison": replace(
            COMPARED,
            gap=Gap(232.0, 213.0, 213.0, 15.3, 29.8, 29.8, (83.0, 229.0)),
            residual=Residual(False, 0.0, (Peak(0.131, "x", 2.1e-3),)),
            remainder=Remainder(0.012, 0.34, 0.012, 0.011, "along the swing", 0.131, 2.1e-3, 1),
        ),
    },
    "unmodelled": {
        "leaves_remainder": True,
        **UNCHANGED,
        "comparison": replace(
            WITHOUT_GAIN,
            gap=Gap(2.0, 1.96, 1.96, 2.0, 1.96, 1.96, (0.0, 0.0)),
            residual=Residual(False, 0.0, (Peak(0.431, "x", 2.1e-3), Peak(0.86, "z", 4e-4))),
            remainder=Remainder(0.23, 0.23, 0.3, 0.1, "across the swing", 0.431, 2.1e-3, None),
        ),
    },
}


def made(verdict: str = "named", **changes: Any) -> Reconciliation:
    """A reconciliation with anything changed, of the comparison with the data too."""
    inside = {name: changes.pop(name) for name in set(changes) & {each.name for each in fields(Comparison)}}
    made = replace(BASE, **{"verdict": verdict, **VERDICTS[verdict], **changes})
    return replace(made, comparison=replace(present(made.comparison), **inside)) if inside else made


@pytest.fixture(scope="session")
def make() -> Maker:
    """A reconciliation of a verdict, with anything else changed."""
    return made


class Reports(dict[str, str]):
    """The report of each verdict, made when first asked for and kept, since drawing takes time."""

    def __missing__(self, verdict: str) -> str:
        self[verdict] = render_report(made(verdict), title=TITLE, software="plumbline 0.1.0")
        return self[verdict]


@pytest.fixture(scope="session")
def reports() -> Reports:
    return Reports()


@pytest.fixture(scope="session")
def pages(reports: Reports) -> Pages:
    return Pages(reports)
