"""One fit with everything free: every effect at once; those whose parameters differ from nothing by enough are named.

`python -m tests.blind.baselines.everything reconcile LOG --rig RIG --held-out LOG2 --json FILE --prediction FILE`
"""

import sys

import numpy as np

from gateway.twin.model import TwinRig
from gateway.twin.simulator.simulator import Simulator
from tests.blind.baselines.files import Found, Measured, answer
from tests.blind.baselines.fitting import (
    Fit,
    base_fit,
    conclude,
    first_start,
    fit_growing,
    free_on_log,
    guesses,
    linear_gain,
    sensible,
)

OTHER_STRUCTURE = {"double_pendulum", "rope_stretch"}
"""They put another body or a spring into the equations, so they cannot be a part of every model."""
SIGNIFICANT = 4.0
"""Standard errors: one in 15,000 by chance."""
ROUNDS = 20


def everything(rig: TwinRig, log: Measured, held_out: Measured) -> Found:
    """All at once."""
    base = base_fit(rig, log)
    residual_g = log.force_g - base.simulator.predict(base.values, log.time_s, log.temperature_c)
    names = [name for name in sensible(log) if name not in OTHER_STRUCTURE]
    start = {name: _best_guess(rig, log, base, name, residual_g) for name in names}
    simulator = Simulator(rig, names)
    starts = [simulator.values(list(initial), start) for initial in (first_start(rig, log), base.values)]
    fits = [fit_growing(simulator, log, values, free_on_log(simulator), ROUNDS) for values in starts]
    fit = min(fits, key=lambda one: one.cost)
    return conclude(rig, log, held_out, base, fit, significant(fit, log.n_values))


def significant(fit: Fit, n_values: int) -> tuple[str, ...]:
    """Effects of which an amplitude is further from neutral than its standard error allows.

    Where the fit leaves more than the stated noise, what it leaves is taken for noise.
    """
    errors = np.full(len(fit.values), np.inf)
    errors[fit.free] = np.sqrt(np.diag(fit.covariance) * max(1.0, fit.cost / n_values))
    named = set()
    for slot, value, error in zip(fit.simulator.parameters, fit.values, errors, strict=True):
        amplitude = slot.effect and not slot.name.endswith(
            ("start_s", "duration_s", "coast_s", "frequency_hz", "phase_rad")
        )
        if amplitude and abs(value - slot.neutral) > SIGNIFICANT * error > 0:
            named.add(slot.effect)
    return tuple(name for name in fit.simulator.effect_names if name in named)


def _best_guess(rig: TwinRig, log: Measured, base: Fit, name: str, residual_g: np.ndarray) -> dict[str, float]:
    """The moment at which an event would explain most."""
    tries = guesses(name, log, residual_g)
    if len(tries) == 1:
        return {} if name in ("clipping", "lowpass_lag") else tries[0]
    simulator = Simulator(rig, [name])
    gains = [
        linear_gain(simulator, log, simulator.values(list(base.values), {name: guess}), free_on_log(simulator))[0]
        for guess in tries
    ]
    return tries[int(np.argmax(gains))]


if __name__ == "__main__":
    sys.exit(answer(everything))
