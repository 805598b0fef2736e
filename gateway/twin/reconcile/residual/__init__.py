"""Residual analysis: spectrum, whiteness, noise inflation, significance."""
