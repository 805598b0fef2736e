"""An effect that needs a value no part has gives way to one with the same signature that does not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.search.ambiguity import replace_implausible
from gateway.twin.reconcile.search.budget import Budget
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import make_context
from gateway.twin.reconcile.search.validation import Validator


def with_unknown(observations: Observations, amplitude_g: float) -> Observations:
    """Add what no effect describes, so that a tilt of some degrees is no longer told from an offset by its second order."""
    time_s = observations.time_s
    unknown_g = amplitude_g * np.sin(2 * np.pi * (0.9 * time_s + 2.0 * np.sin(0.35 * time_s)))
    return replace(observations, force_g=observations.force_g + unknown_g[:, None] * [1.0, -1.0, 0.5])


def replaced(
    model: Model, record: Callable[..., Observations], hidden: EffectValues, unknown_g: float
) -> tuple[frozenset[str], bool]:
    """Names of the set that takes the place of an offset alone, and whether the offset is still a rival."""
    log, selection = (with_unknown(record(hidden, name), unknown_g) for name in ("log", "held_out"))
    context = make_context(model, log, Budget(), lambda: None)
    table = context.fit(CandidateTable(log), {})
    table = context.fit(table, {"axis_offset": {}})
    offset = table.fits[frozenset({"axis_offset"})]
    table, best = replace_implausible(table.start_round(), context, Validator(model.rig, {}, selection), offset)
    return best.names, table.get({"axis_offset"}) is not None


@pytest.mark.slow
@pytest.mark.parametrize(("tilt_deg", "name"), [(10.0, "mount_misalignment"), (3.0, "axis_offset")])
def test_an_offset_no_part_has_beside_a_remainder_is_a_tilt(
    model: Model, record: Callable[..., Observations], tilt_deg: float, name: str
) -> None:
    found, is_rival = replaced(model, record, {"mount_misalignment": {"deg": (tilt_deg, 0.0)}}, 0.02)

    assert (set(found), is_rival) == ({name}, name == "axis_offset")


@pytest.mark.slow
def test_an_offset_no_part_has_stays_where_the_recording_tells_it_from_a_tilt(
    model: Model, record: Callable[..., Observations]
) -> None:
    hidden: EffectValues = {"axis_offset": {"offset_g": (0.2, 0.0, -0.05)}}

    assert replaced(model, record, hidden, 0.0) == (frozenset({"axis_offset"}), True)
