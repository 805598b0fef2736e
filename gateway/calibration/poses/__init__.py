"""Detection of resting poses in the readings: windows, stillness, faces, and means with their uncertainty."""
