"""The nine kinds and their builders."""

from collections.abc import Callable

from tests.working_crane.real.draw import Draw
from tests.working_crane.real.heavy_rope import heavy_rope
from tests.working_crane.real.housing_faults import housing_faults
from tests.working_crane.real.long_hoist import long_hoist
from tests.working_crane.real.moving_base import moving_base
from tests.working_crane.real.pick_up import pick_up
from tests.working_crane.real.reeving import reeving
from tests.working_crane.real.rig import Rig
from tests.working_crane.real.slewing import slewing
from tests.working_crane.real.spreader import spreader
from tests.working_crane.real.windy import windy

KINDS: dict[str, tuple[str, Callable[[Draw], Rig]]] = {
    "a": ("rope with mass and waves", heavy_rope),
    "b": ("reeving with hook block", reeving),
    "c": ("slewing and luffing", slewing),
    "d": ("spreader on four ropes", spreader),
    "e": ("long hoist while swinging", long_hoist),
    "f": ("turbulent wind", windy),
    "g": ("housing and radio", housing_faults),
    "h": ("pick-up, set-down, snag, empty hook, tandem", pick_up),
    "i": ("moving base", moving_base),
}
