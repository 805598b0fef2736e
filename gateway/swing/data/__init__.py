"""Samples made ready for a fit: bins, noise, checks."""
