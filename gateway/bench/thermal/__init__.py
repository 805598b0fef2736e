"""Thermal calibration: zero-g offset and sensitivity against temperature (Sawicki and Walendziuk 2016)."""
