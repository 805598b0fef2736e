"""The verbs of `plumbline fleet`: many sensors, many gateways."""
