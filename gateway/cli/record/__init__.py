"""The verbs of `plumbline record`: what can be done with recordings."""
