"""The composition of the stages: sample blocks in, messages out. No input or output, no clock, no threads."""
