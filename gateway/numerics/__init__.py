"""Statistics and signal processing that several packages share: numpy only, so that the daemon can use it."""
