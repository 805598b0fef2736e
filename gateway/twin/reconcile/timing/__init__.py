"""Errors of the time stamps: samples that were lost without a gap in the time stamps."""
