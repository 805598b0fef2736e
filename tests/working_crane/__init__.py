"""Recordings of a crane at work from a second simulator (MuJoCo), with the rope's true angle at every sample.

Nothing here imports the gateway, the devices or the twin.
"""
