"""The commands that measure, simulate and reconcile."""
