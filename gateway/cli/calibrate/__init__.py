"""The methods of `plumbline calibrate`: offline calibration."""
