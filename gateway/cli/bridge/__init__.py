"""The verbs of `plumbline bridge`."""
