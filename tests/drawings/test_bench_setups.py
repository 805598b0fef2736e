"""Words of the drawings stand on the sheet."""

import re
from collections.abc import Callable

import pytest

from tests.drawings import bench_setups

PX_PER_CHARACTER = 6.6
"""Mean width of a letter of 13 px in the widest of the usual fonts."""
TEXT = re.compile(r'<text x="([-\d.]+)" y="([-\d.]+)" text-anchor="(\w+)"[^>]*>([^<]*)<')
BEFORE = {"start": 0.0, "middle": 0.5, "end": 1.0}


@pytest.mark.parametrize(
    "draw",
    [
        bench_setups.six_faces,
        bench_setups.rotation_rig,
        bench_setups.laser_platform,
        bench_setups.alignment_shaft,
        bench_setups.thermal_chamber,
        bench_setups.girder_ends,
        bench_setups.installed_housing,
    ],
)
def test_words_stand_on_the_sheet(draw: Callable[[], str]) -> None:
    drawing = draw()
    size = re.search(r'viewBox="0 0 (\d+) (\d+)"', drawing)
    assert size is not None
    texts = TEXT.findall(drawing)
    assert len(texts) > 5
    for x, y, anchor, words in texts:
        left = float(x) - BEFORE[anchor] * PX_PER_CHARACTER * len(words)
        assert left >= 0, words
        assert left + PX_PER_CHARACTER * len(words) <= float(size[1]), words
        assert 12 <= float(y) <= float(size[2]) - 4, words
