"""Sensors and radio bases on a serial port, and their frames."""
