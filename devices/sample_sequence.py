"""The sequence numbers of a node's samples: what is new, what was lost, and when the numbers began anew."""

from dataclasses import dataclass

REPEATED_NS = 500_000_000
"""Numbers that stay behind for longer are not late frames: the node has started again. Basis: a choice; a frame that is repeated
comes sooner, and a start takes longer."""
MAX_LATE_S = 10.0
"""A frame is at most this late. Basis: a choice; longer than a base station repeats a frame."""
JUMP_S, JUMP_SHARE = 2.0, 1.25
"""Numbers that run ahead of the time since the last frame by more: the node has started again, or changed its rate. Basis: a
choice; a radio is late by less, and the next rate differs by more."""


@dataclass(frozen=True, slots=True)
class Placement:
    """The place of a frame among the samples."""

    lost: int
    """Number of samples that are missing before it; 0 where the numbers began anew."""
    repeated: int
    """Number of its first samples that are known already."""
    restarted: bool
    """The numbers began anew: what is missing can only be told by time."""


class SampleSequence:
    """Follows numbers that wrap around."""

    def __init__(self, bits: int, odr_hz: float) -> None:
        self._modulus = 1 << bits
        self._odr_hz = odr_hz
        self._next: int | None = None
        self._read_ns = 0
        self._repeated_from_ns: int | None = None

    def restart(self) -> None:
        """Forget the numbers: the node has started again."""
        self._next = None

    def place(self, first: int, count: int, read_ns: int) -> Placement:
        """Return the place of a frame of `count` samples, of which the first has this number."""
        ahead = self._ahead(first)
        restarted = ahead is None or self._is_jump(ahead, count, read_ns)
        if restarted or ahead is None:
            placement = Placement(lost=0, repeated=0, restarted=True)
        else:
            placement = Placement(lost=max(ahead, 0), repeated=min(max(-ahead, 0), count), restarted=False)
        if placement.repeated < count:
            self._next = (first + count) % self._modulus
            self._read_ns = read_ns
            self._repeated_from_ns = None
        return placement

    def _ahead(self, first: int) -> int | None:
        """Return by how much a number is ahead of the expected one; negative: behind."""
        if self._next is None:
            return None
        half = self._modulus // 2
        return (first - self._next + half) % self._modulus - half

    def _is_jump(self, ahead: int, count: int, read_ns: int) -> bool:
        if ahead >= 0:
            passed_s = (read_ns - self._read_ns) / 1e9
            return ahead > (passed_s * JUMP_SHARE + JUMP_S) * self._odr_hz
        if -ahead < count:
            return False
        if self._repeated_from_ns is None:
            self._repeated_from_ns = read_ns
        return -ahead > MAX_LATE_S * self._odr_hz or read_ns - self._repeated_from_ns > REPEATED_NS
