"""What acts all the time shows before an event does: lasting effects that make the beginning of a log one motion.

Over the whole log the event is louder, and no lasting effect comes near what is left. On the beginning alone the score test
ranks them, and the few that promise most are fitted there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gateway.twin.effects.effect import Value
from gateway.twin.reconcile.changepoints.changepoint import FIRST_S, JOINED, ROUNDS, Beginning, beginning, one_motion
from gateway.twin.reconcile.data.observations import piece
from gateway.twin.reconcile.fit.fit_context import Setting
from gateway.twin.reconcile.search.initial_guesses import first_values
from gateway.twin.reconcile.search.score_test import signatures

Values = Mapping[str, Mapping[str, Value]]
FURTHER_S = 10.0
"""By which a beginning must go on for longer with an effect than without."""
TRIED = 6
"""Effects that are fitted to the beginning."""
REACHES = 0.4
"""Share of what the best effect promises there; one with less does not make the beginning one motion."""


def one_motion_with(setting: Setting, base: Values, names: Sequence[str]) -> list[Beginning]:
    """Beginnings with each of the effects beside the base that carries the motion on further than the base does, best first.

    None where the base is one motion until something happens that no lasting effect explains.
    """
    log = setting.log
    alone = beginning(setting, base)
    first_s = FIRST_S if alone is None else float(log.time_s[alone.last]) + FURTHER_S
    last = int(np.searchsorted(log.time_s, first_s))
    found = []
    for values in _promising(replace(setting, log=piece(log, 0, last)), base, names):
        begun = beginning(setting, values)
        if begun is not None and begun.last >= last:
            found.append(begun)
    furthest = max((begun.last for begun in found), default=0)
    return sorted(found, key=lambda begun: begun.chi2(log, furthest))


def _promising(setting: Setting, base: Values, names: Sequence[str]) -> list[Values]:
    """By the score test; those that a fit shows to make one motion of the beginning, where the base makes none."""
    fit = setting.fit(base, rounds=ROUNDS)
    if fit.chi2 < JOINED * setting.log.count:
        return []
    scored = signatures(setting, fit, base, names)
    drops = {name: scored.drop(name) for name in scored.of}
    ranked = sorted(drops, key=lambda name: -drops[name])[:TRIED]
    tried: list[Values] = [
        {**base, name: first_values(name)} for name in ranked if drops[name] > REACHES * drops[ranked[0]]
    ]
    return [values for values in tried if one_motion(setting, values) is not None]
