"""Timings. They are printed for people to compare on one machine in one run, and asserted by no test."""
