"""Bench sessions with known truth, from equations of the papers and numpy alone: nothing of the product is used."""
