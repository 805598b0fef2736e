"""Fits of a model to a recording: initial conditions, multiple shooting, windowed fits, validation."""
