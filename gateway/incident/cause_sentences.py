"""What moved the load before its largest angle, in words."""

from collections.abc import Iterator

from gateway.documents.format import format_fixed, format_percent, format_short
from gateway.incident.cause import CAUSE_BEFORE_S, MIN_MOVE_S, CraneMove
from gateway.incident.facts import IncidentFacts
from gateway.incident.timeline_figure import ReportClock


def cause_sentences(clock: ReportClock, facts: IncidentFacts) -> Iterator[str]:
    """Yield what moved the load before its largest angle, and by which estimate."""
    if facts.peak is None:
        return
    causes, unseen = facts.causes, ""
    peak = "the peak" if facts.angle.is_known else "the largest known angle"
    if causes.unseen_s >= MIN_MOVE_S:
        unseen = (
            f"{format_fixed(causes.unseen_s, 1)} s of the {CAUSE_BEFORE_S:.0f} s before {peak} are not known "
            f"({', '.join(causes.unseen_causes)})"
        )
    live = "" if causes.live_because is None else "by the gateway's live estimate "
    if not causes.moves and unseen:
        yield f"What moved the load cannot be told: {unseen}."
        return
    if not causes.moves:
        seen = "neither the pivot nor the winch was seen to move, and no gust was seen"
        yield f"In the {CAUSE_BEFORE_S:.0f} s before {peak} {live}{seen}."
    for move in causes.moves:
        sure = "" if move.probability is None else f" (probability {format_percent(100 * move.probability)})"
        yield f"Before {peak}, {live}{_move_text(move)} from {clock.time(move.begin_s)} to {clock.time(move.end_s)} UTC{sure}."
    if unseen:
        yield f"Other moves are possible: {unseen}."
    if causes.live_because is None:
        yield "What moved is by the motion that was smoothed over these samples afterwards, as plumbline measure states it."
    else:
        yield f"The live estimate knew only what came before, and may take a gust for a drive; {causes.live_because}."


def _move_text(move: CraneMove) -> str:
    match move.state:
        case "driven":
            size = "" if move.pivot_m_s2 is None else f" by up to {format_short(abs(move.pivot_m_s2), 2)} m/s²"
            return f"trolley, bridge or jib accelerated the rope's upper end{size}"
        case "hoisting":
            size = "" if move.hoist_m_s is None else f" at up to {format_short(abs(move.hoist_m_s), 2)} m/s"
            return f"the winch {'lowered' if (move.hoist_m_s or 0) > 0 else 'hoisted'}{size}"
        case "driven_or_wind":
            return "a gust pushed the load, or trolley, bridge or jib moved: the estimate changed from the second to the first"
        case _:
            return "a gust pushed the load"
