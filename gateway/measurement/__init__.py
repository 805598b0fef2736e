"""A whole recording measured offline, by the same stages that judge it live."""
