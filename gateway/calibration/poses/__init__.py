"""Resting poses in the readings: windows, stillness, faces, means with their uncertainty."""
