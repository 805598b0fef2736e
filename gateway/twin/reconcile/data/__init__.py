"""Recordings made ready for reconciliation, checked, and searched for artefacts of the sensor."""
