"""The checks of `plumbline doctor`, and the diagnostic bundle."""
