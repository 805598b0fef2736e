"""Drawings of the guides, to scale, from their dimensions in mm."""
