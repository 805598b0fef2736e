"""Readings of a simulated crane as the source of a measurement."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.recording import Recording
from gateway.measurement.source import Source
from gateway.recording.reading.interval import RecordingExtent
from gateway.swing.rig import MountedHousing


def source_of(
    time_s: NDArray[np.float64], force_g: NDArray[np.float64], housing: MountedHousing, noise_g: float
) -> Source:
    """Return readings, shape (n, 3), without a gap, as a log of them would be read."""
    none_lost = np.zeros(len(time_s), dtype=np.int64)
    return Source(
        files=(Path("log.csv"),),
        recording=Recording(
            time_s=time_s, raw=force_g, unit="g", lost_before=none_lost, unusable_before=none_lost.copy()
        ),
        extent=RecordingExtent(0.0, float(time_s[-1]), None),
        force_g=force_g,
        permissible_norm_error_g=0.01,
        calibration="as recorded",
        noise_g=noise_g,
        housing=housing,
    )
