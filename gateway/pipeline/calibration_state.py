"""What a pipeline was made for; when any of it changes, another pipeline begins."""

from typing import NamedTuple

from gateway.messages import CalibrationStatus


class PipelineCalibration(NamedTuple):
    """The calibration in force, and whether a recalibration suspends the alerts."""

    calibration_id: str | None
    status: CalibrationStatus
    suspended: bool
