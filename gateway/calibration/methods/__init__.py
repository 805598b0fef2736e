"""Calibration methods: they compute a calibration fit, with its uncertainty, from resting poses or from a rest on the rope."""
