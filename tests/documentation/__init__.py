"""The commands that the documentation prints, run as a reader would."""
