"""Limits of the shape of an event."""

SHARPEST = 0.01
"""The smallest fraction of an event in which it rises and falls. Basis: edges this sharp lie between two samples."""
