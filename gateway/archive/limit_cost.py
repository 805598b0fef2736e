"""What another limit would have cost: the alarms that it would have raised, and the false ones among them."""

from collections.abc import Sequence
from dataclasses import dataclass

import duckdb
import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.stages.alerts import DECISION_FACTOR

TRIED_LIMITS_DEG = tuple(half / 2 for half in range(2, 25))
"""Limits whose cost is stated, 1 to 12 degrees. Basis: a choice; a crane is given one among them."""


@dataclass(frozen=True, slots=True)
class LimitCost:
    """The alarms that another limit would have raised."""

    limit_deg: float
    alarms: int
    false_alarms: int
    """Those in which the best estimate of the angle stayed below the limit."""


def tried_limits(database: duckdb.DuckDBPyConnection) -> tuple[LimitCost, ...]:
    """Return the cost of each limit, by the rule of the alerts for the present angle."""
    share = DECISION_FACTOR / NORMAL_975
    columns = database.execute(
        """
        SELECT number * 4294967296 + minute AS place, angle_deg, angle_deg + ? * (upper_deg - angle_deg) AS compared_deg
        FROM m JOIN (SELECT gateway, row_number() OVER () AS number FROM m GROUP BY gateway) USING (gateway)
        WHERE angle_deg + ? * (upper_deg - angle_deg) >= ? ORDER BY place
        """,
        [share, share, TRIED_LIMITS_DEG[0]],
    ).fetchnumpy()
    place, angle_deg = np.asarray(columns["place"], dtype=np.int64), np.asarray(columns["angle_deg"])
    return limit_costs(place, angle_deg, np.asarray(columns["compared_deg"]), TRIED_LIMITS_DEG)


def limit_costs(
    place: NDArray[np.int64], angle_deg: Array, compared_deg: Array, limits_deg: Sequence[float]
) -> tuple[LimitCost, ...]:
    """Return the alarms of each limit; arrays by minute, shape (n,), where neighbouring minutes have neighbouring places.

    `compared_deg` is what is compared with the limit, `angle_deg` the best estimate.
    """
    costs = []
    for limit_deg in limits_deg:
        is_above = compared_deg >= limit_deg
        minutes, angles_deg = place[is_above], angle_deg[is_above]
        starts = np.flatnonzero(np.diff(minutes, prepend=minutes[:1] - 2) > 1)
        largest_deg = np.maximum.reduceat(angles_deg, starts) if len(starts) else angles_deg
        costs.append(LimitCost(limit_deg, len(starts), int(np.count_nonzero(largest_deg < limit_deg))))
    return tuple(costs)
