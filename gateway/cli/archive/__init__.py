"""The verbs of `plumbline archive`."""
