"""Sensors with a driver of the Linux kernel (Industrial I/O)."""
