"""Recordings prepared for a fit: checks of their quality, and artefacts of the sensor."""
