"""Values, units and status codes of OPC UA. Pure."""

from asyncua import ua

from gateway.bridge.plant_snapshot import PlantSnapshot
from gateway.bridge.plant_state import PlantState
from gateway.bridge.plant_values import PlantValue

NAMESPACE = "urn:plumbline:bridge"
UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"
UNITS = {
    "deg": ("DD", "°"),
    "s": ("SEC", "s"),
    "ms": ("C26", "ms"),
    "d": ("DAY", "d"),
    "%": ("P1", "%"),
    "V": ("VLT", "V"),
}
"""Code and sign of a unit. Definition: UNECE Recommendation 20."""
STATUS: dict[PlantState, int] = {
    PlantState.NO_DATA: ua.StatusCodes.BadWaitingForInitialData,
    PlantState.FINE: ua.StatusCodes.BadNoData,
    PlantState.NOT_KNOWN: ua.StatusCodes.BadDataUnavailable,
    PlantState.UNCALIBRATED: ua.StatusCodes.BadConfigurationError,
    PlantState.SUSPENDED: ua.StatusCodes.BadOutOfService,
    PlantState.SENSOR_GONE: ua.StatusCodes.BadSensorFailure,
    PlantState.STALE: ua.StatusCodes.BadNoCommunication,
    PlantState.GATEWAY_GONE: ua.StatusCodes.BadDeviceFailure,
    PlantState.LINK_GONE: ua.StatusCodes.BadNotConnected,
    PlantState.SIMULATED: ua.StatusCodes.BadNotSupported,
    PlantState.REPLAY: ua.StatusCodes.BadNotSupported,
    PlantState.DUPLICATE: ua.StatusCodes.BadConfigurationError,
    PlantState.BRIDGE_GONE: ua.StatusCodes.BadShutdown,
    PlantState.NOT_AUTHENTICATED: ua.StatusCodes.BadSecurityChecksFailed,
}
"""Why a value is not known; in a fine state: there is none, such as a coming peak of a load at rest."""


def is_measured(value: PlantValue) -> bool:
    """Return whether a value has a fraction; others are counts and codes."""
    return value.float_register is not None


def variant_type(value: PlantValue) -> ua.VariantType:
    """Return the type of a value's node."""
    return ua.VariantType.Double if is_measured(value) else ua.VariantType.UInt32


def data_value(value: PlantValue, snapshot: PlantSnapshot) -> ua.DataValue:
    """Return a value with its status and the time of its sample; without a number where it is not known."""
    number, time = value.number(snapshot), snapshot.sample_time
    if number is None:
        return ua.DataValue(ua.Variant(), ua.StatusCode(STATUS[snapshot.state]), SourceTimestamp=time)
    simulated = is_measured(value) and snapshot.source in ("simulated", "replay")
    status = ua.StatusCodes.UncertainSimulatedValue if simulated else ua.StatusCodes.Good
    exact = float(number) if is_measured(value) else int(number)
    return ua.DataValue(ua.Variant(exact, variant_type(value)), ua.StatusCode(status), SourceTimestamp=time)


def engineering_unit(unit: str) -> ua.EUInformation:
    """Return a unit as OPC UA describes it."""
    code, sign = UNITS[unit]
    return ua.EUInformation(
        NamespaceUri=UNECE,
        UnitId=int.from_bytes(code.encode(), "big"),
        DisplayName=ua.LocalizedText(sign),
        Description=ua.LocalizedText(unit),
    )
