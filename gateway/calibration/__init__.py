"""Calibration: the record, where it is found, and how it is applied."""
