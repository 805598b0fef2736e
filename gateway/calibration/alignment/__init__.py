"""Alignment: rotation of the housing on the rope by its two screws until pitch and roll vanish."""
