"""What is in recordings, for `record info`."""
