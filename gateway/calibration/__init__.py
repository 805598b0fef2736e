"""Calibration: the record, its store and its application; poses, methods, procedures, alignment, drift, offline calibration."""
