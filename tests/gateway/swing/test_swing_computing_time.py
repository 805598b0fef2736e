"""Computing time of fits that fail: they are given up early."""

import numpy as np
import pytest

from gateway.swing.data.bins import bin_samples
from gateway.swing.fit.gauss_newton import SwingFit, iterate, linearise
from gateway.swing.fit.harmonics import find_harmonics
from gateway.swing.fit.initial_guess import initial_motions
from gateway.swing.fit.priors import nominal_prior
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.conftest import Recording, simulate
from tests.values import present

PERIOD_S = 2 * np.pi * np.sqrt(9.0 / 9.80665)
NOISE_G = np.full(3, 4e-4)


@pytest.fixture(scope="module")
def driven() -> Recording:
    """Swung all the time by a trolley that goes to and fro at another rhythm than the load's."""

    def trolley(time_s: float) -> tuple[float, float, float]:
        return (1.5 * np.sin(0.55 * time_s), 0.8 * np.sin(1.9 * time_s + 1), 0.0)

    return simulate(rho=0.4, amplitude_deg=4.0, duration_s=40, push=trolley)


def initial_fit(recording: Recording, rig: MountedHousing) -> SwingFit:
    bins = bin_samples(recording.time_s, recording.force_g, PERIOD_S / 32)
    starts = initial_motions(find_harmonics(bins, NOISE_G, rig), rig, 0.0, float(bins.time_s[-1]) + 0.5)
    return present(linearise(bins, bins.count[:, None] / NOISE_G**2, starts[0], nominal_prior(rig)))


@pytest.mark.slow
def test_a_fit_that_hardly_improves_is_given_up(driven: Recording) -> None:
    fit = initial_fit(driven, MountedHousing(length_m=9.0, position_m=driven.position_m))

    given_up = iterate(fit, 25, lambda _: True)

    assert not given_up.converged
    assert given_up.iterations <= 4


@pytest.mark.slow
def test_a_fit_that_converges_is_never_given_up() -> None:
    recording = simulate(rho=0.4, duration_s=40)
    asked: list[SwingFit] = []

    def note(fit: SwingFit) -> bool:
        asked.append(fit)
        return False

    fit = iterate(initial_fit(recording, MountedHousing(length_m=9.5, position_m=recording.position_m)), 25, note)

    assert fit.converged
    assert not asked
