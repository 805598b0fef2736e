"""OPC UA: in every state a value that is not known has a status that is bad, and no number."""

import pytest
from asyncua import ua

from gateway.bridge.opcua_values import data_value
from gateway.bridge.plant_snapshot import PlantSnapshot, PlantState
from gateway.bridge.plant_values import PLANT_VALUES


@pytest.mark.parametrize("state", PlantState)
def test_what_is_not_known_is_bad_in_every_state(state: PlantState) -> None:
    snapshot = PlantSnapshot(state=state)
    for value in PLANT_VALUES:
        if value.number(snapshot) is None:
            shown = data_value(value, snapshot)
            assert shown.StatusCode is not None
            assert shown.StatusCode.is_bad()
            assert shown.Value == ua.Variant()
