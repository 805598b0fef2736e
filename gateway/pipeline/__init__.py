"""Where the stages meet: sample blocks in, messages out. No I/O, no clock, no threads."""
