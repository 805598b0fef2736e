"""The condition of a reading: static, quasi-static, swinging, disturbed or unknown."""
