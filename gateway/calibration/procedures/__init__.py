"""Calibration procedures: they take readings as they arrive, report progress, and fit at the end."""
