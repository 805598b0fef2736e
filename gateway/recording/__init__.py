"""The flight recorder: writes messages into MCAP files that survive kills and power failures, and reads them back."""
