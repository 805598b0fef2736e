"""The four published formulas and their corrected forms."""

import numpy as np
import pytest

from gateway.swing.formulas import Extremes, LowpassGain, as_published, corrected, extremes
from tests.values import present

PHI = np.radians(10.0)
NAMES = ("arccos_min_az", "arcsin_max_axy", "arctan_max_axy_min_az", "arccos_max_az")


def planar(rho: float, phi: float = PHI, azimuth: float = 0.7) -> Extremes:
    """What an ideal planar swing reads at most (physics derived from Newton's law for a fixed pivot)."""
    across = (1 - rho) * np.sin(phi)
    return Extremes(
        max_x_g=across * np.cos(azimuth),
        max_y_g=across * np.sin(azimuth),
        max_across_g=across,
        min_z_g=np.cos(phi),
        max_z_g=1 + 2 * rho * (1 - np.cos(phi)),
    )


@pytest.mark.parametrize(
    ("rho", "readings_deg"),
    [(0.5, (10.00, 4.98, 5.04, 7.07)), (1.0, (10.00, 0.00, 0.00, 10.00)), (0.0, (10, 10, 10, 0))],
)
def test_published_formulas_read_as_derived_for_each_mounting(rho: float, readings_deg: tuple[float, ...]) -> None:
    angles = as_published(planar(rho))

    assert [np.degrees(getattr(angles, name)) for name in NAMES] == pytest.approx(readings_deg, abs=0.01)


@pytest.mark.parametrize("rho", [0.02, 0.2, 0.5, 0.8, 0.98])
def test_corrected_formulas_invert_exactly(rho: float) -> None:
    angles = corrected(planar(rho), rho)

    assert [getattr(angles, name) for name in NAMES] == pytest.approx([PHI] * 4, rel=1e-9)


def test_corrected_formulas_invert_a_known_low_pass() -> None:
    ideal, gain_f0, gain_2f0 = planar(0.4), 0.9, 0.8
    centre, half = (ideal.max_z_g + ideal.min_z_g) / 2, (ideal.max_z_g - ideal.min_z_g) / 2
    passed = Extremes(
        max_x_g=gain_f0 * ideal.max_x_g,
        max_y_g=gain_f0 * ideal.max_y_g,
        max_across_g=gain_f0 * ideal.max_across_g,
        min_z_g=centre - gain_2f0 * half,
        max_z_g=centre + gain_2f0 * half,
    )

    angles = corrected(passed, 0.4, LowpassGain(gain_f0=gain_f0, gain_2f0=gain_2f0))

    assert [getattr(angles, name) for name in NAMES] == pytest.approx([PHI] * 4, rel=1e-9)


def test_an_argument_out_of_the_domain_gives_no_angle() -> None:
    still_with_noise = Extremes(max_x_g=0.01, max_y_g=1.2, max_across_g=1.2, min_z_g=1.002, max_z_g=0.999)

    angles = as_published(still_with_noise)

    assert angles.arccos_min_az is None  # arccos(1.002)
    assert angles.arcsin_max_axy is None  # arcsin(1.2)
    assert angles.arctan_max_axy_min_az == pytest.approx(np.arctan2(np.hypot(0.01, 1.2), 1.002))
    assert angles.arccos_max_az is None  # arccos(1.0005)


def test_where_the_mounting_leaves_nothing_to_invert_there_is_no_angle() -> None:
    assert corrected(planar(1.0), 1.0).arcsin_max_axy is None
    assert corrected(planar(1.0), 1.0).arctan_max_axy_min_az is None
    assert corrected(planar(0.0), 0.0).arccos_max_az is None
    assert (
        as_published(Extremes(max_x_g=0, max_y_g=0, max_across_g=0, min_z_g=-1, max_z_g=1)).arctan_max_axy_min_az
        is None
    )


def test_extremes_take_the_transverse_maximum_of_one_sample() -> None:
    force_g = np.array([[0.3, 0.0, 0.9], [0.0, 0.4, 1.1], [-0.5, 0.1, 1.0]])

    found = extremes(force_g)

    assert found == Extremes(max_x_g=0.3, max_y_g=0.4, max_across_g=np.hypot(0.5, 0.1), min_z_g=0.9, max_z_g=1.1)
    assert extremes(np.empty((0, 3))) is None
    assert found.joined(present(extremes(np.array([[0.6, 0.0, 0.8]])))).max_x_g == 0.6
