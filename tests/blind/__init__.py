"""Recordings with a hidden effect from a second simulator, and the score of what `plumbline reconcile` says of them.

Mechanics by MuJoCo, a sensor chain of its own. But for `baselines`, which may use the twin's equations of motion, nothing here
imports the gateway, the devices or the twin.
"""
