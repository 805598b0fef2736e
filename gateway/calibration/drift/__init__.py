"""Drift: how offset and scale move between records, and what a hook at rest shows of it."""
