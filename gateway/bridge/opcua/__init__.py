"""The server of OPC UA: a node for each value with unit and range, and each change of an alert as an event."""
