"""Calibration procedures: they take readings as they come, show progress, and fit at the end."""
