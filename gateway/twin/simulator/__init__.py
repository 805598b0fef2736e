"""The simulator: symbolic equations assembled from effects, compiled, integrated with exact sensitivities."""
