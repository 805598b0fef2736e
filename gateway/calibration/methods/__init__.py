"""Calibration methods: from resting poses, or a rest on the rope, to a fit with its uncertainty."""
