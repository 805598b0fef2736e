"""Errors of the time stamps: timing jitter and lost samples."""
