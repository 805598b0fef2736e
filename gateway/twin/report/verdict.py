"""What was found, in one sentence, and what it means for who runs the crane."""

from dataclasses import dataclass

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import Gap, NamedEffect, Reconciliation
from gateway.twin.report.markup import Html, element, facts, items, joined, paragraph
from gateway.twin.report.models import fitted_part
from gateway.twin.report.words import listed, number, percent, plain, sentence, span, times_noise

WORDS = {
    "data_unusable": ("No answer", "unusable"),
    "none_missing": ("Nothing missing", "agrees"),
    "named": ("Cause named", "found"),
    "one_of": ("One of several", "doubt"),
    "named_with_remainder": ("Named in part", "doubt"),
    "unmodelled": ("Unknown cause", "unknown"),
}


@dataclass(frozen=True, slots=True)
class Answer:
    """A verdict in words."""

    sentence: str
    meanings: tuple[Html, ...]
    """What each name means, one by one."""
    advice: str
    """What to do with it."""


def verdict_part(result: Reconciliation) -> Html:
    """The answer, and the gap in a few numbers."""
    word, kind = WORDS[result.verdict]
    answer = answer_of(result)
    return joined(
        [
            element(
                "section",
                element("p", word, class_="word"),
                element("p", answer.sentence, class_="answer"),
                items(answer.meanings) if answer.meanings else "",
                *_advice(result, answer),
                class_=f"verdict {kind}",
                id="verdict",
            ),
            _numbers(result.gap, result) if result.gap else "",
        ]
    )


def _advice(result: Reconciliation, answer: Answer) -> tuple[Html, ...]:
    """The reason first where it is what to mend."""
    advice = paragraph(answer.advice)
    if not result.reason.strip():
        return (advice,)
    if result.verdict == "data_unusable":
        return (paragraph(sentence(result.reason)), advice)
    return (advice, paragraph("Why this verdict: ", sentence(result.reason)))


def answer_of(result: Reconciliation) -> Answer:
    """The sentence, the meanings and the advice of a verdict."""
    sure = certain(result)
    meanings = tuple(_meaning(effect) for effect in sure)
    names = listed([effect.name for effect in sure])
    them = "it" if len(sure) == 1 else "them"
    match result.verdict:
        case "data_unusable":
            text = "The recording cannot be used, so there is no answer."
            return Answer(
                text, (), "This says nothing about the crane or the sensor; do not take it for “all is well”."
            )
        case "none_missing":
            text = "Nothing is missing: simulation and measurement agree down to the sensor’s noise."
            return Answer(text, meanings, NOTHING_TO_DO)
        case "named":
            text = f"The simulation lacked {names}. With {them}, it agrees with the measurement."
            return Answer(text, meanings, f"Look for this on the crane or the sensor; {NEXT_TIME}")
        case "one_of":
            return _one_of(result, meanings)
        case "named_with_remainder":
            text = f"The simulation lacked {names} – and something more that is not known."
            return Answer(
                text,
                meanings,
                f"The named part is what the data hold. {left_over(result)} {NO_NAME}",
            )
        case "unmodelled":
            text = "Something acts that no effect known to this program explains."
            return Answer(text, meanings, f"{left_over(result)} {NO_NAME}")


NOTHING_TO_DO = (
    "Nothing needs doing. This holds for what this recording could show: its length, the size of its swing, "
    "and the time it was taken."
)
NEXT_TIME = "once confirmed, write it into the rig’s description, so that the next comparison starts from there."
NO_NAME = "It has no name here: look at what else acted on the load, the rope or the sensor."


def certain(result: Reconciliation) -> tuple[NamedEffect, ...]:
    """Effects that are named for themselves, not as one of a group."""
    group = set(result.candidates) if result.verdict == "one_of" else set()
    return tuple(effect for effect in result.effects if effect.name not in group)


def left_over(result: Reconciliation) -> str:
    """What the model after does not explain."""
    peaks = result.residual.peaks if result.residual else ()
    if not peaks:
        return f"{_misses(result.gap)}; no single frequency stands out in what remains."
    strongest = ", ".join(f"{number(p.hz)} Hz on {p.axis} ({number(1e3 * p.amplitude_g, 2)} mg)" for p in peaks[:3])
    return f"{_misses(result.gap)}; what remains is strongest at {strongest}."


def _misses(gap: Gap | None) -> str:
    if gap is None:
        return "How much remains is not known"
    misses = f"The best model still misses by {times_noise(gap.after_log)}"
    return misses if gap.after_held_out is None else f"{misses}, on held-out data by {times_noise(gap.after_held_out)}"


def _one_of(result: Reconciliation, meanings: tuple[Html, ...]) -> Answer:
    if not result.candidates:
        text = f"One of several effects {CANNOT_TELL}; their names were not recorded."
    else:
        text = f"One of these {CANNOT_TELL}: {listed(result.candidates, 'or')}."
    group = tuple(_candidate(name) for name in result.candidates)
    named = tuple(joined(["Beside it, named for itself – ", meaning]) for meaning in meanings)
    split = f"To tell them apart: {sentence(result.split_by)}" if result.split_by else NO_SPLIT
    return Answer(text, group + named, f"{split} Until then do not act on one of them alone.")


CANNOT_TELL = "explains the difference, and this recording cannot tell which"
NO_SPLIT = "No manoeuvre or measurement that would tell them apart was found."


def _meaning(effect: NamedEffect) -> Html:
    acted = f" It acted {_acted(effect.when_s)}." if effect.when_s else ""
    return joined([element("strong", plain(effect.name)), f": {sentence(effect.explains)}{acted}"])


def _acted(when_s: tuple[float, float]) -> str:
    text = span(*when_s)
    return (
        f"{text} after the start of the recording"
        if text.startswith("at ")
        else f"from {text} after the recording’s start"
    )


def _candidate(name: str) -> Html:
    known = EFFECTS.get(name)
    return joined([element("strong", plain(name)), f": {sentence(known.explains)}" if known else ""])


def _numbers(gap: Gap, result: Reconciliation) -> Html:
    held_out = (
        "its last third, not fitted to," if result.held_out_is_last_third else "the held-out recording, not fitted to,"
    )
    return facts(
        [
            (f"Misses {fitted_part(result)} by", _from_to(gap.before_log, gap.after_log)),
            ("of that gap, closed", _closed(gap.before_log, gap.after_log)),
            (f"Misses {held_out} by", _from_to(gap.before_held_out, gap.after_held_out)),
            ("of that gap, closed", _closed(gap.before_held_out, gap.after_held_out)),
        ]
    )


def _from_to(before: float | None, after: float | None) -> str:
    if before is None or after is None:
        return "not judged"
    return times_noise(before) if before == after else f"{times_noise(before).split()[0]} → {times_noise(after)}"


def _closed(before: float | None, after: float | None) -> str:
    if before is None or after is None:
        return "not judged"
    if before == after:
        return "the same before and after"
    closed = Gap.closed_percent(before, after)
    return "nothing was open" if closed is None else percent(min(closed, 100.0))
