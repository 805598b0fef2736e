"""Where samples come from: the configured device, the thread that reads it, and what it counts."""
