"""The Foxglove WebSocket protocol, by which viewers look at a gateway live."""
