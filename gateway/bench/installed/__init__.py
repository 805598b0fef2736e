"""Calibration of a housing that stays on its rope, from the free swings and rests of weeks of service."""
