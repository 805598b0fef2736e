"""Calibration on the bench: recordings fed to the procedures that the gateway runs live."""
