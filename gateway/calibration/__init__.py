"""Calibration: record, store and application; poses, methods, procedures, alignment, drift; calibration from files."""
