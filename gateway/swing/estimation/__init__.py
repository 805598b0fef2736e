"""From fits to an estimate: outliers, choice of the prior, segments, hoists."""
