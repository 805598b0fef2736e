"""The swing stage of the pipeline: its set-up, the validity of its estimate, and its message."""

from collections import deque
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.messages import Formulas, Swing
from gateway.numerics.stats import NORMAL_975
from gateway.pipeline.executor import Executor, Future
from gateway.pipeline.header import Header
from gateway.pipeline.mounting import mounted_housing, with_sensor
from gateway.stages.conditions.gates import SwingContext
from gateway.stages.lowpass import LowPass
from gateway.swing.estimate import SwingEstimate
from gateway.swing.live import SwingTracker
from gateway.swing.rig import MountedHousing
from gateway.units import degrees

FIT_DELAY_S = 0.25
"""An estimate is used this long after its newest sample. It is the time for the fit, the same live and in a replay."""
VALIDITY_S = 2.0
"""An estimate is valid for this long, or for one period if that is longer."""


class SwingStage:
    """Feeds the tracker and keeps its last estimate."""

    def __init__(
        self,
        configuration: Configuration,
        info: DeviceInfo,
        correction: Correction,
        lowpass: LowPass,
        executor: Executor,
    ) -> None:
        rig = mounted_housing(configuration, correction, info.bandwidth_hz)
        self._rig = rig
        self._correction, self._bandwidth_hz = correction, info.bandwidth_hz
        self._beyond_k = 0
        self._temperature_c: float | None = None
        self._range_warnings: tuple[str, ...] = ()
        self._tracker = None if rig is None else SwingTracker(rig, noise_g=info.noise_g, lowpass_gain=lowpass.gain)
        self._estimate: SwingEstimate | None = None
        self._executor = executor
        self._pending: deque[tuple[float, Future[SwingEstimate | None]]] = deque()
        """Running fits with the time of their newest sample, oldest first."""
        self._now_s = 0.0

    def update(
        self,
        time_s: NDArray[np.float64],
        force_g: NDArray[np.float64],
        lowpassed_g: NDArray[np.float64],
        temperature_c: float | None = None,
    ) -> bool:
        """Take a block; return whether there is a new estimate, made from the samples up to `FIT_DELAY_S` ago.

        `temperature_c`: that of the sensor; outside the calibration's range it widens the intervals.
        """
        self._now_s = float(time_s[-1])
        if self._tracker is None:
            return False
        rig = self._rig_at(temperature_c)
        fit = self._executor.submit(self._tracker.update, time_s, force_g, lowpassed_g, rig)
        self._pending.append((self._now_s, fit))
        estimate = None
        while self._pending and self._pending[0][0] <= self._now_s - FIT_DELAY_S:
            estimate = self._pending.popleft()[1].result() or estimate
        if estimate is None:
            return False
        self._estimate = replace(estimate, reasons=(*estimate.reasons, *self._range_warnings))
        return True

    def _rig_at(self, temperature_c: float | None) -> MountedHousing | None:
        """Return the housing with the uncertainties at a new temperature; None where nothing has changed."""
        if temperature_c is None or temperature_c == self._temperature_c or self._rig is None:
            return None
        self._temperature_c = temperature_c
        beyond_k, before_k = self._correction.kelvin_beyond(temperature_c), self._beyond_k
        self._beyond_k, self._range_warnings = beyond_k, self._correction.range_warnings(temperature_c)
        if beyond_k == before_k:
            return None
        return with_sensor(self._rig, self._correction.widened_by(beyond_k), self._bandwidth_hz)

    @property
    def _current(self) -> SwingEstimate | None:
        """The last estimate while it is valid."""
        estimate = self._estimate
        if estimate is None:
            return None
        validity_s = max(VALIDITY_S, estimate.period_s or 0.0)
        return estimate if self._now_s - estimate.to_s <= validity_s else None

    def condition_context(self) -> SwingContext:
        """Return the part of the estimate that the condition stage needs."""
        estimate = self._current
        if estimate is None:
            return SwingContext(None, None, consistent=False)
        coverage = estimate.coverage95_rad
        rho = None if self._rig is None or estimate.length_m is None else self._rig.rho_at(estimate.length_m)
        widest_rad = estimate.phi_max_rad if coverage is None else coverage[1]
        return SwingContext(
            estimate.swinging,
            widest_rad,
            consistent=coverage is not None,
            rho=rho,
            period_s=estimate.period_s,
            lean_g=estimate.lean_g,
            hoisting=estimate.hoisting,
        )

    @property
    def why_unknown(self) -> tuple[str, ...]:
        """Why there is no coverage interval to compare with a limit; empty where there is one."""
        if self._tracker is None:
            return ("where the housing is on the rope is not configured",)
        estimate = self._current
        if estimate is None:
            return ("less than a full swing observed",)
        return () if estimate.coverage95_rad is not None else estimate.reasons

    def upper_confidence_limits(self) -> tuple[float | None, float | None]:
        """Return the upper 95 % limits of swing and lean in radians; None where they are not known."""
        estimate = self._current
        if estimate is None:
            return None, None
        swing_rad = None if estimate.coverage95_rad is None else estimate.coverage95_rad[1]
        if estimate.prediction is not None and estimate.prediction.u_rad is not None and swing_rad is not None:
            swing_rad = max(swing_rad, estimate.prediction.phi_max_rad + NORMAL_975 * estimate.prediction.u_rad)
        if estimate.lean_rad is None or estimate.lean_u_rad is None:
            return swing_rad, None
        return swing_rad, estimate.lean_rad + NORMAL_975 * estimate.lean_u_rad

    def message(self, header: Header) -> Swing:
        """Return the last estimate in degrees."""
        estimate = self._estimate
        if estimate is None:
            raise ValueError("there is no estimate yet")
        coverage, prediction = estimate.coverage95_rad, estimate.prediction
        return Swing(
            **header,
            swinging=estimate.swinging,
            phi_max_deg=degrees(estimate.phi_max_rad),
            u_deg=degrees(estimate.u_rad),
            coverage95_deg=None if coverage is None else [float(np.degrees(end)) for end in coverage],
            minor_phi_max_deg=degrees(estimate.minor_phi_max_rad),
            azimuth_deg=degrees(estimate.azimuth_rad),
            lean_deg=degrees(estimate.lean_rad),
            lean_azimuth_deg=degrees(estimate.lean_azimuth_rad),
            period_s=estimate.period_s,
            predicted_phi_max_deg=None if prediction is None else degrees(prediction.phi_max_rad),
            predicted_u_deg=None if prediction is None else degrees(prediction.u_rad),
            time_to_peak_s=self._time_to_peak_s(estimate),
            formulas_deg=formulas_message(estimate),
            reasons=list(estimate.reasons),
        )

    def _time_to_peak_s(self, estimate: SwingEstimate) -> float | None:
        """Return the time from the newest sample to the next peak; 0 if it has passed while the fit was running."""
        if estimate.prediction is None:
            return None
        return max(0.0, estimate.to_s + estimate.prediction.time_to_peak_s - self._now_s)


def formulas_message(estimate: SwingEstimate) -> Formulas:
    """Return the four published formulas over the last swing, in degrees."""
    if estimate.formulas is None:
        return Formulas(arccos_min_az=None, arcsin_max_axy=None, arctan_max_axy_min_az=None, arccos_max_az=None)
    return Formulas(**{name: degrees(angle_rad) for name, angle_rad in asdict(estimate.formulas).items()})
