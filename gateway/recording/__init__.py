"""The flight recorder: samples and messages to MCAP files that survive, and back."""
