"""The twin: a simulation assembled from effects, and where it and the measurement part."""
