"""Blunders that people make at the bench, planted by the second generator and run through the command line."""
