"""What a fit supports: covariance, misfit, and the rope's largest angles with their uncertainties."""
