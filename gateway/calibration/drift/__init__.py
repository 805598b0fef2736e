"""Drift: how offset and scale change between records, and what the readings at rest show of it."""
