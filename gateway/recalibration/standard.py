"""The ways of calibrating that a session offers: those of the offline command, the same code."""

import numpy as np

from devices.block import DeviceInfo
from gateway.calibration.acceptance import Acceptance, judge
from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.methods.zeroing import zero_in_place
from gateway.calibration.poses.nominal_sensitivity import NominalSensitivity
from gateway.calibration.poses.pose import RawReadings
from gateway.calibration.procedures.pose_procedure import PoseProcedure
from gateway.calibration.procedures.procedure_factory import make_procedure
from gateway.calibration.record import CalibrationRecord

Axes = tuple[tuple[int, int], ...]
"""(sensor axis, sign) of each housing axis."""


class StandardMethods:
    """`gateway.recalibration.methods.Methods` for a sensor that is built into its housing so."""

    def __init__(self, axes: Axes) -> None:
        self._turn = np.zeros((3, 3))
        for housing_axis, (sensor_axis, sign) in enumerate(axes):
            self._turn[housing_axis, sensor_axis] = sign

    def procedure(self, method: str, device: DeviceInfo, parent: CalibrationRecord | None) -> PoseProcedure:
        """A procedure that has seen nothing yet; a norm fit, which cannot see the frame, keeps that of `parent`."""
        return make_procedure(method, NominalSensitivity(device.units_per_g), parent=parent)

    def zero(self, readings: RawReadings, parent: CalibrationRecord, device: DeviceInfo) -> CalibrationFit:
        """The parent with the mount's two angles removed. Raises `CalibrationError`."""
        return zero_in_place(readings, parent, self._turn, device.units_per_g)

    def judge(self, fit: CalibrationFit, parent: CalibrationRecord | None) -> Acceptance:
        """Return whether the record of a fit may replace its parent."""
        return judge(fit, parent)
