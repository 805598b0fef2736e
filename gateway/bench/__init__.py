"""Bench methods: calibrations and measurements with means that are not part of the gateway, such as a rig, an oven or a laser."""
