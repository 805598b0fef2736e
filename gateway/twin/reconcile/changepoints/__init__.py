"""Changepoints: when a transient effect began and ended."""
