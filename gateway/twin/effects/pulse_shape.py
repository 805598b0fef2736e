"""Limits of the shape of an event."""

SHARPEST = 0.01
"""Least share of an event in which it rises and falls; edges this sharp fall between two samples."""
