"""Operating conditions of a reading: static, swinging, disturbed, unknown."""
