"""Alignment of the housing on the rope by its two screws."""
