"""The simulator: symbolic equations assembled from effects, compiled, and integrated with sensitivities."""
