"""The rigger of the simulated crane: does what the session of a recalibration asks for."""

from typing import TYPE_CHECKING

from devices.device import Device
from gateway.configuration.model import Configuration
from gateway.messages import CalibrationSession

if TYPE_CHECKING:
    from devices.simulated.device import SimulatedCrane


class SimulatedRigger:
    """Follows the session as a person at the hook follows the page."""

    def __init__(self, crane: "SimulatedCrane") -> None:
        self._crane = crane
        self._direction: tuple[float, ...] | None = None
        self._is_off_rope = False

    def follow(self, session: CalibrationSession) -> None:
        """Turn the housing to the next face, or hang it back on the rope after the session."""
        if session.suspended and session.phase == "collecting" and session.next_direction is not None:
            direction = tuple(session.next_direction)
            if direction != self._direction:
                self._crane.turn_housing(direction)
                self._direction, self._is_off_rope = direction, True
        elif self._is_off_rope and not session.suspended:
            self._crane.hang_housing()
            self._direction, self._is_off_rope = None, False


def make_rigger(configuration: Configuration, device: Device) -> SimulatedRigger | None:
    """Return the rigger of the simulated crane; None where a person turns the housing."""
    if configuration.device.kind != "simulated":
        return None
    from devices.simulated.device import SimulatedCrane

    return SimulatedRigger(device) if isinstance(device, SimulatedCrane) else None
