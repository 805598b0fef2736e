"""Analysis of residuals: whiteness, spectral lines, noise inflation, isolability."""
