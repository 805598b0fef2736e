"""Offline calibration: recordings are fed to the procedures that the gateway runs live."""
