"""What the session needs of the calibration: procedures, records, the judge, the zero."""

from typing import Protocol

from devices.block import DeviceInfo
from gateway.calibration.acceptance import Acceptance
from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.poses.pose import RawReadings
from gateway.calibration.procedures.pose_procedure import PoseProcedure
from gateway.calibration.record import CalibrationRecord


class Methods(Protocol):
    """The ways of calibrating a device from afar."""

    def procedure(self, method: str, device: DeviceInfo, parent: CalibrationRecord | None) -> PoseProcedure:
        """A procedure that has seen nothing yet; `parent` is the record that a new one follows."""
        ...

    def zero(self, readings: RawReadings, parent: CalibrationRecord, device: DeviceInfo) -> CalibrationFit:
        """The parent with the mount's two angles removed. Raises `CalibrationError`."""
        ...

    def judge(self, fit: CalibrationFit, parent: CalibrationRecord | None) -> Acceptance:
        """Return whether the record of a fit may replace its parent."""
        ...
