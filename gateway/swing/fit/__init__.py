"""The most likely motion of a window: harmonics, priors, multiple shooting, Gauss-Newton."""
