"""Sources of samples: sensors, recordings, the simulated crane, the buses they use, and the sample clock."""
