"""The stages: pure, told the time, unaware of each other."""
