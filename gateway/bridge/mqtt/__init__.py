"""The publisher to an MQTT broker: the state retained, each change of an alert once and in order, Home Assistant's discovery."""
