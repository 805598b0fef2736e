"""The clamp of the drawing holds every rope that it names."""

import pytest

from gateway.cli.main import parser
from tests.drawings.clamp import DRAWN_GROOVE, DRAWN_ROPE, GROOVES, LEAST_GAP, LEVER, SCREW, Groove


@pytest.mark.parametrize("groove", GROOVES)
def test_the_halves_clamp_the_ropes_of_their_range(groove: Groove) -> None:
    least, most = GROOVES[groove]
    assert all(groove.holds(rope) for rope in (least, (least + most) / 2, most))
    assert not groove.holds(0.8 * least)
    assert not groove.holds(1.2 * most)


def test_ranges_of_ropes_leave_none_out() -> None:
    (_, end), (begin, _) = GROOVES.values()
    assert begin == end


def test_a_rope_touches_a_v_of_90_degrees_where_geometry_says() -> None:
    """A circle of radius r touches the faces of a V at r from its centre, which stands r sqrt(2) from the bottom."""
    bottom = DRAWN_GROOVE.gap(DRAWN_ROPE) / 2 + DRAWN_GROOVE.depth
    distance_of_face = bottom / 2**0.5
    assert distance_of_face == pytest.approx(DRAWN_ROPE / 2)
    assert DRAWN_GROOVE.gap(DRAWN_ROPE) > LEAST_GAP


def test_screws_are_those_for_which_the_alignment_gives_advice() -> None:
    taken = parser().parse_args(["remote", "align"])
    assert (taken.lever_mm, taken.lead_mm) == (LEVER, 0.5)  # the lead of M3
    assert SCREW == 3.0
