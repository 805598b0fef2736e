"""Offline measurement of recordings with the stages of the live pipeline."""
