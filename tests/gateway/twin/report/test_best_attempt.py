"""Where nothing explains the data, the best attempt is told with its values, and as no explanation."""

from gateway.twin.reconcile.output.serialisation import to_json, to_text
from tests.gateway.twin.report.conftest import Maker

ATTEMPT = {"viscous_damping": {"damping_ratio": 0.004}, "axis_offset": {"offset_g": (0.001, -0.002, 0.0)}}


def test_the_best_attempt_is_told_where_nothing_explains_the_data(make: Maker) -> None:
    result = make("unmodelled", model=ATTEMPT)
    text = to_text(result)
    assert "best attempt viscous_damping (damping_ratio 0.004); axis_offset (offset_g 0.001,-0.002,0 g)" in text
    assert "not an explanation" in text
    assert to_json(result, 1.0)["best_attempt"] == {
        "viscous_damping": {"damping_ratio": 0.004},
        "axis_offset": {"offset_g": [0.001, -0.002, 0.0]},
    }


def test_named_effects_are_no_attempt(make: Maker) -> None:
    result = make("named", model=ATTEMPT)
    assert "best attempt" not in to_text(result)
    assert to_json(result, 1.0)["best_attempt"] == {}
