"""Fits of a model to a recording: initial conditions, multiple shooting, intervals."""
