"""Samples that a radio lost without a trace, found by time: from then on every sample seems to arrive later.

A late arrival alone is no loss, for delays vary. A loss of m samples delays all later arrivals by at least m periods against
the line of the sample clock, which lies below all earlier ones. The latest delays are compared with the delays before them: if
each is as unlikely as q, k of them by chance have the probability q^k. They must last, for a host that stalled reads its
backlog at once; and they must be so many that the least of them states the number of periods. Before that, only what exceeds the
largest delay before them is taken for lost.
"""

from collections import deque

MAX_REMEMBERED_DELAYS = 256
"""Number of usual delays that are remembered. Basis: a choice; delays of seconds to minutes, and a bound of the memory."""
MAX_RUN_DELAYS = 64
"""Number of the latest delays in which a loss is searched for. Basis: a choice; a loss shows within it, and the search stays
cheap."""
MAX_P_CHANCE = 1e-6
"""Largest probability by chance at which a loss is assumed. Basis: a choice; with ten reads per second once in a day."""
MIN_PERIOD_SHARE = 0.75
"""Least delay that counts, as a share of a period. Basis: a smaller delay is no lost sample."""
MIN_RUN_NS = 200_000_000
"""Shortest time of delays that show a loss. Basis: a choice; longer than a host is late for once."""
MAX_P_MISCOUNT = 1e-3
"""Largest probability that the number is wrong, because every arrival was late by half a period or more besides. Basis: a choice;
a wrong number shifts times by a period."""


class UncountedLoss:
    """Watches the delays of arrivals and returns the number of samples that are missing."""

    def __init__(self) -> None:
        self._usual = deque[int](maxlen=MAX_REMEMBERED_DELAYS)
        self._run = deque[tuple[int, int]](maxlen=MAX_RUN_DELAYS)  # (delay_ns, read_ns)

    def restart(self) -> None:
        """Forget the delays, after a pause or with a new line."""
        self._usual.clear()
        self._run.clear()

    def add(self, delay_ns: int, read_ns: int, period_ns: float) -> int:
        """Add the delay of the newest sample against its expected time; return the number of lost samples, usually 0."""
        self._run.append((delay_ns, read_ns))
        if delay_ns < MIN_PERIOD_SHARE * period_ns:
            self._usual.extend(delay for delay, _ in self._run)
            self._run.clear()
            return 0
        least_ns, count, start_ns = self._least_likely()
        if read_ns - start_ns < MIN_RUN_NS or self._chance(least_ns, count) > MAX_P_CHANCE:
            return 0
        if self._chance(round(period_ns / 2), count) <= MAX_P_MISCOUNT:
            lost = max(round(least_ns / period_ns), 1)
        else:  # the rest is found later
            lost = int(max(least_ns - max(self._usual, default=0), 0) / period_ns)
        if lost:
            self._run.clear()
        return lost

    def _least_likely(self) -> tuple[int, int, int]:
        """Return the least delay, number and start of those latest delays that are least likely by chance."""
        least_ns, choices = self._run[-1][0], []
        for count, (delay_ns, read_ns) in enumerate(reversed(self._run), 1):
            least_ns = min(least_ns, delay_ns)
            choices.append((self._chance(least_ns, count), least_ns, count, read_ns))
        return min(choices)[1:]

    def _chance(self, least_ns: int, count: int) -> float:
        as_late = sum(usual_ns >= least_ns for usual_ns in self._usual)
        chance: float = ((as_late + 1) / (len(self._usual) + 2)) ** count
        return chance


def lost_in_pause(last_ns: int | None, first_ns: int, odr_hz: float) -> int:
    """Return the number of samples that are missing between two, by their times; 0 where there is none before."""
    if last_ns is None:
        return 0
    return max(round((first_ns - last_ns) / 1e9 * odr_hz) - 1, 0)
