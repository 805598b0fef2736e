"""Every text that a page chooses by what the gateway sends is there in every language, and its pages choose no other."""

from typing import get_args

import pytest

from gateway.calibration.alignment.turn_advice import TurnAdvice
from gateway.calibration.record import PoseMethod
from gateway.languages import LANGUAGES, read_texts
from gateway.messages import CalibrationStatus, HealthState, Level, MotionState, Verdict
from gateway.messages.header import ReasonCode
from gateway.page.verdict import STYLES
from gateway.stages.condition import DISTURBING, UNUSABLE

SENT = {
    "verdict": get_args(Verdict),
    "calibration": get_args(CalibrationStatus),
    "state": get_args(HealthState),
    "method": tuple(PoseMethod),
    "shaft": get_args(TurnAdvice.__annotations__["state"]),
    "level": tuple(level for level in get_args(Level) if level != "normal"),
    "word": tuple(STYLES),
}


@pytest.mark.parametrize("language", LANGUAGES)
def test_everything_that_the_gateway_sends_has_a_text(language: str) -> None:
    texts = read_texts(language)
    assert [
        f"{kind}_{value}" for kind, values in SENT.items() for value in values if f"{kind}_{value}" not in texts
    ] == []
    assert set(get_args(MotionState)) - {"unknown"} <= set(texts)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_reason_pose_and_advice_has_a_text(language: str) -> None:
    """A reason has no other code than one of these: the type checker sees to it."""
    texts, gates = read_texts(language), {*UNUSABLE, *DISTURBING}
    assert {*get_args(ReasonCode)} >= gates
    wanted = {f"gate_{code}" if code in gates else f"reason_{code}" for code in get_args(ReasonCode)}
    assert wanted - set(texts) == set()
    assert {key for key in texts if key.startswith(("reason_", "gate_"))} - wanted == set()


def test_no_text_of_another_language_is_english() -> None:
    english = read_texts("en")
    for language in LANGUAGES[1:]:
        texts = read_texts(language)
        same = {key for key, text in texts.items() if len(text.split()) > 2 and text == english[key]}
        assert same <= SAME_IN_BOTH, language


SAME_IN_BOTH = {"acknowledged_by", "plus_minus", "shaft_errors"}
"""Numbers, signs and names alone."""
