"""Recalibration over the network: requests, session, interlock, journal and audit. Time is an argument of every call."""
