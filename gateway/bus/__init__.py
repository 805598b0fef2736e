"""Zenoh sessions, and the client of a gateway."""
